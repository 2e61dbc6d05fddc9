"""Today's physics engines on the scenes of this book; each is optional and skipped when absent.

`data/README.md` describes the scenes.  Settings: `default`, only restitution is given; `refined`,
small step, many iterations, what adds or takes energy off.
"""

import math
from collections.abc import Callable
from functools import cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np
from measure import BULLET, RAPIER, Row, distance, named_engines, outcome, present, versions
from scenes import SCENES, Scene
from scipy.optimize import brentq
from solvers import model_error

SPEED, RADIUS = 2.0, 0.5
PLACEMENTS = {"apart": 1e-2, "touching": 0.0, "pressed": -1e-5}  # gap over diameter
CHUNK = 10  # steps between looks at the state

#: Two balls, which every engine must get right before its chains mean anything.
CHECKS = {
    name: Scene(name, (1.0, 1.0), (e,), (), (), "exact")
    for name, e in (("two equal, e = 1", 1.0), ("two equal, e = .5", 0.5))
}


class Line(NamedTuple):
    """Balls on a line as an engine is given them."""

    masses: tuple
    restitution: tuple
    placement: str

    @property
    def velocities(self):
        """m/s."""
        return [SPEED] + [0.0] * (len(self.masses) - 1)

    @property
    def factors(self):
        """One number a ball; the product over a contact is its restitution."""
        factors = [1.0]
        for e in self.restitution:
            factors.append(e / factors[-1])
        # All of even place times s and of odd place over s: the products stay, the largest meet.
        s = math.sqrt(max(factors[1::2]) / max(factors[::2]))
        return [x * s if i % 2 == 0 else x / s for i, x in enumerate(factors)]

    def balls(self):
        """Yield mass, place (m), velocity and factor of each ball."""
        pitch = 2.0 * RADIUS * (1.0 + PLACEMENTS[self.placement])
        places = [pitch * i for i in range(len(self.masses))]
        return zip(self.masses, places, self.velocities, self.factors, strict=True)


class World(NamedTuple):
    """A line of balls in an engine."""

    advance: Callable  #: makes so many steps
    velocities: Callable  #: returns them, ball by ball, m/s
    close: Callable = lambda: None  #: gives back what the engine holds
    kept: object = None  #: what the engine needs and does not keep


def by_one(step):
    """Return a function that makes so many steps, one by one."""
    return lambda count: [step() for _ in range(count)]


# Each engine: a function that makes the world.


def chipmunk(line, *, step, iterations):
    """Chipmunk through pymunk: sequential impulses with a restitution bias."""
    import pymunk

    space = pymunk.Space()
    space.iterations = iterations
    bodies = []
    for mass, x, v, factor in line.balls():
        body = pymunk.Body(mass, math.inf)
        body.position, body.velocity = (x, 0), (v, 0)
        ball = pymunk.Circle(body, RADIUS)
        ball.elasticity, ball.friction = factor, 0.0
        space.add(body, ball)
        bodies.append(body)
    return World(by_one(partial(space.step, step)), lambda: [b.velocity.x for b in bodies])


def box2d(line, *, step, iterations, faster=1.0):
    """Box2D 2.3. `faster` scales all speeds and the step: its threshold of 1 m/s is fixed."""
    from Box2D import b2CircleShape, b2ContactListener, b2FixtureDef, b2World

    class Restitution(b2ContactListener):
        def PreSolve(self, contact, _):
            pair = contact.fixtureA.body.userData, contact.fixtureB.body.userData
            contact.restitution = line.restitution[min(pair)]

    world = b2World(gravity=(0, 0), doSleep=False)
    world.contactListener = listener = Restitution()
    bodies = [
        world.CreateDynamicBody(
            position=(x, 0),
            linearVelocity=(v * faster, 0),
            fixedRotation=True,
            allowSleep=False,  # the world's doSleep alone lets slow balls sleep, at rest
            userData=i,
            fixtures=b2FixtureDef(
                shape=b2CircleShape(radius=RADIUS),
                density=mass / (math.pi * RADIUS**2),
                friction=0.0,
                restitution=1.0,
            ),
        )
        for i, (mass, x, v, _) in enumerate(line.balls())
    ]
    return World(
        by_one(partial(world.Step, step / faster, iterations, 3)),
        lambda: [b.linearVelocity.x / faster for b in bodies],
        kept=listener,
    )


def bullet(line, *, step, iterations, **parameters):
    import pybullet

    world = pybullet.connect(pybullet.DIRECT)
    here = {"physicsClientId": world}
    pybullet.setGravity(0, 0, 0, **here)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=step, numSolverIterations=iterations, **parameters, **here
    )
    ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS, **here)
    bodies = []
    for mass, x, v, factor in line.balls():
        body = pybullet.createMultiBody(mass, ball, basePosition=(x, 0, 0), **here)
        pybullet.changeDynamics(
            body, -1, restitution=factor, lateralFriction=0, rollingFriction=0,
            spinningFriction=0, linearDamping=0, angularDamping=0, **here,
        )  # fmt: skip
        pybullet.resetBaseVelocity(body, (v, 0, 0), **here)
        bodies.append(body)
    return World(
        by_one(partial(pybullet.stepSimulation, **here)),
        lambda: [pybullet.getBaseVelocity(b, **here)[0][0] for b in bodies],
        partial(pybullet.disconnect, world),  # Bullet has room for about a thousand worlds
    )


def rapier(line, *, step, iterations, **parameters):
    """Rapier in three dimensions and single precision."""
    import rapier3d

    world = rapier3d.PhysicsWorld()
    world.integration_parameters.dt = step
    world.integration_parameters.num_solver_iterations = iterations
    for name, value in parameters.items():
        setattr(world.integration_parameters, name, value)
    product = rapier3d.CoefficientCombineRule.MULTIPLY
    bodies = []
    for mass, x, v, factor in line.balls():
        body = rapier3d.RigidBody.dynamic().translation((x, 0, 0)).linvel((v, 0, 0))
        ball = rapier3d.Collider.ball(RADIUS).mass(mass).friction(0.0).restitution(factor)
        ball = ball.restitution_combine_rule(product)
        bodies.append(world.add_body(body.can_sleep(False), [ball]))
    return World(by_one(world.step), lambda: [world.rigid_bodies[b].linvel.x for b in bodies])


def mujoco(line, *, step, steps_a_contact, damping=None):
    """MuJoCo: contacts as constraints that follow a spring of given frequency and damping ratio."""
    import mujoco as engine

    stiffness = (math.pi / (steps_a_contact * step)) ** 2
    damping = damping or [damping_for(e, step, steps_a_contact) for e in line.restitution]
    balls = "".join(
        f'<body pos="{x!r} 0 0"><joint type="slide" axis="1 0 0"/>'
        f'<geom name="{i}" type="sphere" size="{RADIUS}" mass="{mass!r}" contype="0" '
        'conaffinity="0"/></body>'
        for i, (mass, x, *_) in enumerate(line.balls())
    )
    # Negative numbers are stiffness and damping themselves; a constant impedance leaves them so.
    pairs = "".join(
        f'<pair geom1="{c}" geom2="{c + 1}" condim="1" solimp=".95 .95 .001 .5 2" '
        f'solref="{-stiffness!r} {-2.0 * ratio * math.sqrt(stiffness)!r}"/>'
        for c, ratio in enumerate(damping)
    )
    model = engine.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step!r}" gravity="0 0 0"/>'
        f"<worldbody>{balls}</worldbody><contact>{pairs}</contact></mujoco>"
    )
    data = engine.MjData(model)
    data.qvel[:] = line.velocities
    return World(partial(engine.mj_step, model, data), lambda: data.qvel)


@cache
def damping_for(restitution, step, steps_a_contact):
    """Return the damping ratio that gives two balls this restitution."""
    if restitution == 1.0:
        return 0.0
    line = Line((1.0, 1.0), (restitution,), "touching")

    def excess(damping):
        made = mujoco(line, step=step, steps_a_contact=steps_a_contact, damping=[damping])
        _, (v1, v2) = run(made, step, 3.0)
        return (v2 - v1) / SPEED - restitution

    return brentq(excess, 0.0, 0.95, xtol=1e-6)


FINE = 1e-4
MANY = {"step": FINE, "iterations": 1000}
ENGINES = named_engines(  # what makes its world: default, refined, note
    {
        chipmunk: (
            {"step": 1 / 60, "iterations": 10},
            MANY,
            "step 1/60 s as in its manual's example",
        ),
        box2d: (
            {"step": 1 / 60, "iterations": 8},
            MANY | {"faster": 1000.0},
            "closings below 1 m/s do not rebound; refined: all speeds times 1000",
        ),
        bullet: (
            {"step": 1 / 240, "iterations": 50},
            MANY | BULLET,
            "refined: no correction of overlaps, no slop, no threshold",
        ),
        rapier: (
            {"step": 1 / 60, "iterations": 4},
            RAPIER | {"step": FINE, "iterations": 4, "num_internal_pgs_iterations": 200},
            "single precision; refined: no prediction of contacts, 200 inner iterations",
        ),
        mujoco: (
            {"step": 2e-3, "steps_a_contact": 10},
            {"step": 1e-5, "steps_a_contact": 100},
            "no coefficient of restitution: stiffness and damping of the contact are chosen, the "
            "damping from two balls",
        ),
    }
)


def run(world, step, longest):
    """Step until all balls are apart and in order of velocity; return steps and velocities."""
    taken, off, v = 0, np.inf, np.inf
    # Nothing more to come: in order of velocity, and the same as at the last look.
    while taken * step < longest and (off >= 1e-6 * SPEED or np.diff(v).min() <= -1e-6 * SPEED):
        world.advance(CHUNK)
        taken += CHUNK
        v, before = np.array(world.velocities()), v
        off = np.abs(v - before).max()
    world.close()
    return taken, v


def parts(engine, scene, placement, setting):
    """Return a function that makes a world, and one that runs it."""
    options, line = getattr(engine, setting), Line(scene.masses, scene.restitution, placement)
    # Across gaps slow balls need long to meet; where all touch, what is left is jitter.
    longest = 10.0 if placement == "apart" else 3.0 if setting == "default" else 1.0
    to_the_end = partial(run, step=options["step"], longest=longest)
    return partial(engine.scene, line, **options), to_the_end


def solve(engine, scene, placement, setting):
    """Return steps and velocities over the striker's speed, of one engine on one scene."""
    make, to_the_end = parts(engine, scene, placement, setting)
    steps, v = to_the_end(make())
    return steps, v / SPEED


def rows(clock, quick):
    """Yield a row for each engine, setting, scene and placement."""
    settings, scenes = ("default", "refined")[: 2 - quick], (CHECKS | SCENES).values()
    cases = product(present(ENGINES), settings, scenes, PLACEMENTS)
    for engine, setting, scene, placement in cases:
        steps, after = solve(engine, scene, placement, setting)
        time = {}
        if scene.name in CHECKS:
            e = scene.restitution[0]
            off = distance(after, [(1 - e) / 2, (1 + e) / 2])
            error = {"model_error": off, "model_reference": "two balls, exact"}
        else:
            error = model_error(scene, after)
            if placement == "touching":
                make, to_the_end = parts(engine, scene, placement, setting)
                time = clock(to_the_end, prepare=make)
        about = {
            "group": "engine", "model": engine.name, "note": engine.note, "needs": "e",
            "gives": "velocities, path in time", "versions": versions(engine.distribution),
            "parameter": getattr(engine, setting)["step"], "evaluations": steps,
        } | outcome(scene.masses, scene.velocities, after)  # fmt: skip
        yield Row(**about, setting=f"{setting}, {placement}", chain=scene.name, **error, **time)
