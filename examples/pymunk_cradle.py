"""Newton's cradle in Chipmunk (pymunk): `pip install pymunk cradle-companion`."""

import math

import pymunk

from cradle import Chain, ImpulseCorrelation
from cradle.row import Row

BALLS, RADIUS, LENGTH, MASS = 5, 0.1, 1.0, 1.0  # m, kg
ANGLE = math.radians(30)


class Bodies:
    """What the row asks of the engine."""

    def __init__(self, space, balls):
        self.space, self.balls = space, balls

    def motion(self):
        return [b.position for b in self.balls], [b.velocity for b in self.balls]

    def push(self, ball, impulse):
        body = self.balls[ball]
        body.apply_impulse_at_world_point(impulse, body.position)

    def advance(self, step):
        self.space.step(step)


def cradle(pulled=1, angle=ANGLE, *, mend=True, gap=0.0, iterations=10):
    """Hang five balls, pull some of them back; return the engine's world and the balls."""
    space = pymunk.Space()
    space.gravity, space.iterations = (0, -9.81), iterations
    balls = []
    for i in range(BALLS):
        pivot = (2 * RADIUS * (1 + gap) * i, 0)
        turn = -angle if i < pulled else 0.0
        ball = pymunk.Body(MASS, math.inf)
        ball.position = pivot[0] + LENGTH * math.sin(turn), -LENGTH * math.cos(turn)
        shape = pymunk.Circle(ball, RADIUS)
        shape.elasticity, shape.friction = 1.0, 0.0
        if mend:  # balls of one group do not collide with each other, only with everything else
            shape.filter = pymunk.ShapeFilter(group=1)
        space.add(ball, shape, pymunk.PinJoint(space.static_body, ball, pivot, (0, 0)))
        balls.append(ball)
    return Bodies(space, balls)


def mended(bodies):
    """Let the package solve the impacts of the row."""
    chain = Chain([MASS] * BALLS, [0] * BALLS, restitution=1)
    pivots = [(2 * RADIUS * i, 0) for i in range(BALLS)]
    return Row(bodies, chain, ImpulseCorrelation(0.1325), RADIUS, pivots)


if __name__ == "__main__":
    row = mended(cradle())
    for step in range(5001):
        if step % 500 == 0:
            places, _ = row.bodies.motion()
            print(*(f"{x - 2 * RADIUS * i:7.3f}" for i, (x, _) in enumerate(places)))
        row.step(1 / 1000)
