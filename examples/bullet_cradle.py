"""Newton's cradle in Bullet: `pip install pybullet` and this package."""

import math

import pybullet

from cradle import Chain, SpringChain, warm_up
from cradle.row import Row

BALLS, RADIUS, LENGTH, MASS = 5, 0.1, 1.0, 1.0  # m, kg
ANGLE = math.radians(30)
# Spheres; the outer balls are apart, as on a desk strikers come one by one.
TOY = SpringChain(1e10, gaps=[4e-4, 0, 0, 4e-4])  # N/m^1.5, m


class Bodies:
    """What the row asks of the engine; each ball is an arm with a joint."""

    def __init__(self, client, balls, pivots):
        self.client, self.balls, self.pivots = client, balls, pivots

    def motion(self):
        states = [
            pybullet.getJointState(b, 0, physicsClientId=self.client)
            for b in self.balls
        ]
        arms = [
            (LENGTH * math.sin(s[0]), -LENGTH * math.cos(s[0]))
            for s in states
        ]
        places = [
            (p + x, y) for p, (x, y) in zip(self.pivots, arms, strict=True)
        ]
        return places, [
            (-s[1] * y, s[1] * x)
            for s, (x, y) in zip(states, arms, strict=True)
        ]

    def push(self, ball, impulse):
        angle, rate, *_ = pybullet.getJointState(
            self.balls[ball], 0, physicsClientId=self.client
        )
        along = impulse[0] * math.cos(angle) + impulse[1] * math.sin(angle)
        pybullet.resetJointState(
            self.balls[ball],
            0,
            angle,
            rate + along / (MASS * LENGTH),
            physicsClientId=self.client,
        )

    def advance(self, step):
        pybullet.setTimeStep(step, physicsClientId=self.client)
        pybullet.stepSimulation(physicsClientId=self.client)

    def close(self):
        """Give the world back: Bullet has room for about a thousand."""
        pybullet.disconnect(self.client)


def hang(pulled=1, angle=ANGLE, *, mend=True, gap=0.0, **parameters):
    """Hang five balls and pull some of them back."""
    client = pybullet.connect(pybullet.DIRECT)
    here = {"physicsClientId": client}
    pybullet.setGravity(0, 0, -9.81, **here)
    pybullet.setPhysicsEngineParameter(**parameters, **here)
    # Both the shape and the mass of a ball sit at the end of its arm.
    end = (0, 0, -LENGTH)
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_SPHERE,
        radius=RADIUS,
        collisionFramePosition=end,
        **here,
    )
    balls, pivots = [], [2 * RADIUS * (1 + gap) * i for i in range(BALLS)]
    for i, x in enumerate(pivots):
        ball = pybullet.createMultiBody(
            0, basePosition=(x, 0, 0), linkMasses=[MASS],
            linkCollisionShapeIndices=[shape], linkVisualShapeIndices=[-1],
            linkPositions=[(0, 0, 0)], linkOrientations=[(0, 0, 0, 1)],
            linkInertialFramePositions=[end],
            linkInertialFrameOrientations=[(0, 0, 0, 1)],
            linkParentIndices=[0], linkJointTypes=[pybullet.JOINT_REVOLUTE],
            linkJointAxis=[(0, -1, 0)], **here,
        )  # fmt: skip
        # As on two strings: the ball itself does not turn.
        pybullet.changeDynamics(
            ball, 0, restitution=1, lateralFriction=0, linearDamping=0,
            angularDamping=0, jointDamping=0,
            localInertiaDiagonal=(1e-9, 1e-9, 1e-9), **here,
        )  # fmt: skip
        pybullet.changeDynamics(
            ball, -1, linearDamping=0, angularDamping=0, **here
        )
        # Bullet brakes a joint unless its motor has no force.
        pybullet.setJointMotorControl2(
            ball, 0, pybullet.VELOCITY_CONTROL, force=0, **here
        )
        pybullet.resetJointState(
            ball, 0, -angle if i < pulled else 0.0, **here
        )
        for other in balls if mend else []:
            pybullet.setCollisionFilterPair(ball, other, 0, 0, 0, **here)
        balls.append(ball)
    return Bodies(client, balls, pivots)


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
