"""Newton's cradle in pymunk: `pip install pymunk` and this package."""

import math

import pymunk

from cradle import Chain, SpringChain, warm_up
from cradle.row import Row

BALLS, RADIUS, LENGTH, MASS = 5, 0.1, 1.0, 1.0  # m, kg
ANGLE = math.radians(30)
# Spheres; the outer balls are apart, as on a desk strikers come one by one.
TOY = SpringChain(1e10, gaps=[4e-4, 0, 0, 4e-4])  # N/m^1.5, m


class Bodies:
    """What the row asks of the engine."""

    def __init__(self, space, balls):
        self.space, self.balls = space, balls

    def motion(self):
        balls = self.balls
        return [b.position for b in balls], [b.velocity for b in balls]

    def push(self, ball, impulse):
        body = self.balls[ball]
        body.apply_impulse_at_world_point(impulse, body.position)

    def advance(self, step):
        self.space.step(step)


def hang(pulled=1, angle=ANGLE, *, mend=True, gap=0.0, iterations=10):
    """Hang five balls and pull some of them back."""
    space = pymunk.Space()
    space.gravity, space.iterations = (0, -9.81), iterations
    balls = []
    for i in range(BALLS):
        pivot = (2 * RADIUS * (1 + gap) * i, 0)
        turn = -angle if i < pulled else 0.0
        ball = pymunk.Body(MASS, math.inf)
        x = pivot[0] + LENGTH * math.sin(turn)
        ball.position = x, -LENGTH * math.cos(turn)
        shape = pymunk.Circle(ball, RADIUS)
        shape.elasticity, shape.friction = 1.0, 0.0
        if mend:  # one group: no contacts with each other
            shape.filter = pymunk.ShapeFilter(group=1)
        string = pymunk.PinJoint(space.static_body, ball, pivot, (0, 0))
        space.add(ball, shape, string)
        balls.append(ball)
    return Bodies(space, balls)


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
