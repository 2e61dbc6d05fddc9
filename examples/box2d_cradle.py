"""Newton's cradle in Box2D 2.3: `pip install box2d` and this package."""

import math

from Box2D import b2CircleShape, b2Filter, b2FixtureDef, b2World

from cradle import Chain, SpringChain, warm_up
from cradle.row import Row

BALLS, RADIUS, LENGTH, MASS = 5, 0.1, 1.0, 1.0  # m, kg
ANGLE = math.radians(30)
# Spheres; the outer balls are apart, as on a desk strikers come one by one.
TOY = SpringChain(1e10, gaps=[4e-4, 0, 0, 4e-4])  # N/m^1.5, m


class Bodies:
    """What the row asks of the engine."""

    def __init__(self, world, balls, iterations):
        self.world, self.balls, self.iterations = world, balls, iterations

    def motion(self):
        places = [b.position.tuple for b in self.balls]
        return places, [b.linearVelocity.tuple for b in self.balls]

    def push(self, ball, impulse):
        body = self.balls[ball]
        body.ApplyLinearImpulse(impulse, body.position, True)

    def advance(self, step):
        self.world.Step(step, *self.iterations)


def hang(pulled=1, angle=ANGLE, *, mend=True, gap=0.0, iterations=(8, 3)):
    """Hang five balls and pull some of them back."""
    world = b2World(gravity=(0, -9.81), doSleep=False)
    beam = world.CreateStaticBody()
    balls = []
    for i in range(BALLS):
        pivot = (2 * RADIUS * (1 + gap) * i, 0)
        turn = -angle if i < pulled else 0.0
        ball = world.CreateDynamicBody(
            position=(
                pivot[0] + LENGTH * math.sin(turn),
                -LENGTH * math.cos(turn),
            ),
            fixedRotation=True,
            allowSleep=False,
            fixtures=b2FixtureDef(
                shape=b2CircleShape(radius=RADIUS),
                density=MASS / (math.pi * RADIUS**2),
                friction=0.0,
                restitution=1.0,
                # One negative group: no contacts with each other.
                filter=b2Filter(groupIndex=-1 if mend else 0),
            ),
        )
        world.CreateDistanceJoint(
            bodyA=beam,
            bodyB=ball,
            anchorA=pivot,
            anchorB=ball.position,
            collideConnected=False,
        )
        balls.append(ball)
    return Bodies(world, balls, iterations)


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
