"""Newton's cradle in MuJoCo: `pip install mujoco` and this package."""

import math

import mujoco

from cradle import Chain, SpringChain, warm_up
from cradle.row import Row

BALLS, RADIUS, LENGTH, MASS = 5, 0.1, 1.0, 1.0  # m, kg
ANGLE = math.radians(30)
# Spheres; the outer balls are apart, as on a desk strikers come one by one.
TOY = SpringChain(1e10, gaps=[4e-4, 0, 0, 4e-4])  # N/m^1.5, m


class Bodies:
    """What the row asks of the engine, which keeps angles."""

    def __init__(self, model, data, pivots):
        self.model, self.data, self.pivots = model, data, pivots

    def motion(self):
        angles, rates = self.data.qpos.tolist(), self.data.qvel.tolist()
        arms = [
            (LENGTH * math.sin(a), -LENGTH * math.cos(a)) for a in angles
        ]
        places = [
            (p + x, y) for p, (x, y) in zip(self.pivots, arms, strict=True)
        ]
        return places, [
            (-w * y, w * x) for w, (x, y) in zip(rates, arms, strict=True)
        ]

    def push(self, ball, impulse):
        angle = self.data.qpos[ball]
        along = impulse[0] * math.cos(angle) + impulse[1] * math.sin(angle)
        self.data.qvel[ball] += along / (MASS * LENGTH)

    def advance(self, step):
        self.model.opt.timestep = step
        mujoco.mj_step(self.model, self.data)


def hang(pulled=1, angle=ANGLE, *, mend=True, gap=0.0, contact=0.02):
    """Hang five balls and pull some of them back.

    MuJoCo knows no coefficient of restitution: its own contacts are springs
    without damping here, and last so many seconds.
    """
    pivots = [2 * RADIUS * (1 + gap) * i for i in range(BALLS)]
    stiffness = (math.pi / contact) ** 2
    balls = "".join(
        f'<body pos="{x} 0 0"><joint type="hinge" axis="0 -1 0"/>'
        # As on two strings: the ball itself does not turn.
        f'<inertial pos="0 0 {-LENGTH}" mass="{MASS}" '
        'diaginertia="1e-9 1e-9 1e-9"/>'
        f'<geom name="{i}" type="sphere" size="{RADIUS}" '
        f'pos="0 0 {-LENGTH}" contype="0" conaffinity="0"/></body>'
        for i, x in enumerate(pivots)
    )
    pairs = "".join(
        f'<pair geom1="{i}" geom2="{i + 1}" condim="1" '
        f'solimp=".95 .95 .001 .5 2" solref="{-stiffness} 0"/>'
        for i in range(BALLS - 1)
    )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option gravity="0 0 -9.81"/>'
        f"<worldbody>{balls}</worldbody>"
        f"<contact>{'' if mend else pairs}</contact></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[:pulled] = -angle
    return Bodies(model, data, pivots)


def mended(bodies, law=TOY):
    """Let the package solve the impacts of the row."""
    chain = Chain([MASS] * BALLS, [0] * BALLS, restitution=1)
    pivots = [(2 * RADIUS * i, 0) for i in range(BALLS)]
    return Row(bodies, chain, law, RADIUS, pivots)


if __name__ == "__main__":
    warm_up()
    row = mended(hang())
    for step in range(5001):
        if step % 500 == 0:  # how far each ball is out
            at = [x for x, _ in row.bodies.motion()[0]]
            print(
                *(f"{x - 2 * RADIUS * i:z7.3f}" for i, x in enumerate(at))
            )
        row.step(1 / 1000)
