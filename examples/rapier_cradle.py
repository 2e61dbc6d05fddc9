"""Newton's cradle in Rapier: `pip install rapier3d` and this package."""

import math

import rapier3d

from cradle import Chain, SpringChain, warm_up
from cradle.row import Row

BALLS, RADIUS, LENGTH, MASS = 5, 0.1, 1.0, 1.0  # m, kg
ANGLE = math.radians(30)
# Spheres; the outer balls are apart, as on a desk strikers come one by one.
TOY = SpringChain(1e10, gaps=[4e-4, 0, 0, 4e-4])  # N/m^1.5, m


class Bodies:
    """What the row asks of the engine, in the plane of x and y."""

    def __init__(self, world, balls):
        self.world, self.balls = world, balls

    def motion(self):
        balls = [self.world.rigid_bodies[b] for b in self.balls]
        places = [ball.translation for ball in balls]
        speeds = [ball.linvel for ball in balls]
        return [(p.x, p.y) for p in places], [(v.x, v.y) for v in speeds]

    def push(self, ball, impulse):
        self.world.rigid_bodies[self.balls[ball]].apply_impulse(
            (*impulse, 0.0), True
        )

    def advance(self, step):
        self.world.integration_parameters.dt = step
        self.world.step()


def hang(pulled=1, angle=ANGLE, *, mend=True, gap=0.0, **parameters):
    """Hang five balls and pull some of them back."""
    world = rapier3d.PhysicsWorld()
    world.gravity = (0.0, -9.81, 0.0)
    for name, value in parameters.items():
        setattr(world.integration_parameters, name, value)
    balls = []
    for i in range(BALLS):
        pivot = (2 * RADIUS * (1 + gap) * i, 0.0, 0.0)
        turn = -angle if i < pulled else 0.0
        place = (
            pivot[0] + LENGTH * math.sin(turn),
            -LENGTH * math.cos(turn),
            0.0,
        )
        beam = world.add_body(rapier3d.RigidBody.fixed().translation(pivot))
        shape = (
            rapier3d.Collider.ball(RADIUS)
            .mass(MASS)
            .friction(0.0)
            .restitution(1.0)
        )
        if mend:  # a member of group 1, which meets all groups but its own
            group = rapier3d.Group.GROUP_1
            shape = shape.collision_groups(
                rapier3d.InteractionGroups(group, ~group)
            )
        body = (
            rapier3d.RigidBody.dynamic().translation(place).can_sleep(False)
        )
        body = body.locked_axes(rapier3d.LockedAxes.ROTATION_LOCKED)
        ball = world.add_body(body, [shape])
        joint = (
            rapier3d.RopeJoint.builder(LENGTH)
            .local_anchor1((0, 0, 0))
            .local_anchor2((0, 0, 0))
        )
        world.impulse_joints.insert(beam, ball, joint.build(), True)
        balls.append(ball)
    return Bodies(world, balls)


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
