"""What is refused, in which words: chains, models, swings, measures, tables, pictures, advice.

A row is a call and the beginning of what it says.  `test_entries.py` asks every argument of every
entry point for whatever is no such value at all.
"""

import re

import numpy as np
import pytest
from chains import striking
from stored import DATA

from cradle import (
    Chain,
    ConstantLoss,
    EnergyDistribution,
    FusedChain,
    ImpulseCorrelation,
    Pendulums,
    QuadraticDissipation,
    SequentialCollisions,
    SpeedDependent,
    SpringChain,
    Trace,
    ViscousLoss,
    collide,
    hertz_stiffness,
    paper_chain,
    post_impact_velocities,
    recommend,
    spring_velocities,
    swing,
    viscosity_from,
)
from cradle.closed_form import (
    back_impact_line,
    final_impulses,
    first_ball_stops,
    largest_ratios,
    middle_ball_stops,
    one_collision_each,
    three_balls,
)
from cradle.fit import read_tracker, velocities_from_tracks
from cradle.measures import bouncing_pattern, condition_number, effective_ratio
from cradle.pictures.animation import animate_swing
from cradle.pictures.impacts import velocity_impulse

NAN, INF, ONES = np.nan, np.inf, np.ones(3)
HUNT = {"damping": "hunt-crossley"}
PAIR = {"masses": [1, 1], "velocities": [1, 0]}
THREE, LOSSY = striking(), striking(e=0.9)
TRACE = collide(THREE, ImpulseCorrelation(0.1))
FILM = DATA / "video_synthetic.txt"
RUN = swing(Chain([1, 1], [0, 0]), SequentialCollisions(), [-0.03, 0], [0.0, 0.1])


def chain(**change):
    return Chain(**({"masses": [1, 2, 3], "velocities": [1, 0, -1], "restitution": 1} | change))


def ratio_of(velocities):
    return effective_ratio(collide(Chain(np.ones(len(velocities)), velocities),
                                   SequentialCollisions()))  # fmt: skip


def light(masses, door):
    """A ball too light for the event loop, at every door."""
    velocities = [1.0] + [0.0] * (len(masses) - 1)
    if door == "batch":
        return post_impact_velocities(masses, velocities, 1, 0)
    return collide(Chain(masses, velocities), ImpulseCorrelation(0))


def viscosity(masses, restitution, speed=1, stiffness=1):
    return viscosity_from(restitution, speed=speed, masses=masses, stiffness=stiffness)


def struck(model, masses=ONES, velocities=(1, 0, 0), e=1.0):
    return collide(Chain(masses, velocities, e), model)


def springs(**options):
    return collide(THREE, SpringChain(**options))


UNDEFINED = "velocities leave it undefined which balls move as one body: contacts "
LIGHT = "must be at least 1e-150 of the heaviest ball of its chain"

CHAINS = [
    ({"masses": [1, 0, 1]}, "masses[1] = 0.0; must be above 0"),
    ({"masses": [1, NAN, 1]}, "masses[1] = nan; must be finite"),
    ({"masses": [1, 1e-151, 1]}, f"masses[1] = 1e-151; {LIGHT}"),
    ({"masses": [2.0, 1e-150, 2.0]}, f"masses[1] = 1e-150; {LIGHT}"),
    ({"masses": [1.0]}, "masses has shape (1,); a chain needs (N,) with N >= 2: one row of two or"),
    ({"masses": [[1, 1, 1]]}, "masses has shape (1, 3); a chain needs (N,) with N >= 2"),
    ({"masses": [1, 1]}, "velocities has shape (3,); 2 masses need (2,)"),
    ({"velocities": [1, 0]}, "velocities has shape (2,); 3 masses need (3,): one velocity for eac"),
    ({"velocities": [1, NAN, 0]}, "velocities[1] = nan; must be finite"),
    ({"velocities": [0, 1e200, 0]}, "velocities[1] = 1e+200; kinetic energy overflows: choose lar"),
    ({"masses": [1e200] * 3, "velocities": [1e70, 0, 0]}, "velocities[0] = 1e+70; kinetic energy"),
    ({"masses": [1.7e308, 1e308, 1e308], "velocities": [1, 0, 0]}, "velocities[0] = 1.0; momentum"),
    ({"restitution": [0.5, 1.2]}, "restitution[1] = 1.2; must lie in [0, 1]"),
    ({"restitution": 1 + 2**-52}, "restitution = 1.0000000000000002; must lie in [0, 1]"),
    ({"restitution": [1, 1e-31]}, "restitution[1] = 1e-31; must be 0 or at least 1e-30"),
    ({"restitution": [1, 1, 1]}, "restitution has shape (3,); 3 balls need () or (2,): one number"),
    ({"masses": [1, 1], "velocities": [1, 0], "restitution": [1, 1]},
     "restitution has shape (2,); 2 balls need () or (1,): one number, or one for each contact"),
    ({"masses": [1, [2, 3], 4]}, "masses[1] has shape (2,), masses[0] has (); must have one shape"),
    ({"velocities": [1j, 0, 0]}, "velocities[0] = 1j; must be a real number"),
    ({"restitution": "1"}, "restitution = '1'; must be real numbers"),
]  # fmt: skip

BATCH = [
    ({"masses": [1, -1, 1]}, "masses[1] = -1.0; must be above 0"),
    ({"masses": [[1, 1, 1], [1, 1, 0]]}, "masses[1, 2] = 0.0; must be above 0"),
    ({"masses": [1, 1e-151, 1]}, "masses[1] = 1e-151; must be at least 1e-150"),
    ({"masses": 1.0}, "masses has shape (); must be (..., N) with N >= 2"),
    ({"masses": [[1.0]]}, "masses has shape (1, 1); must be (..., N) with N >= 2"),
    ({"velocities": [1, 0]}, "velocities has shape (2,); must be (..., 3), as masses"),
    ({"velocities": [[1, 0, np.nan]]}, "velocities[0, 2] = nan; must be finite"),
    ({"velocities": [[0, 0, 0], [1, 0, 1e200]]}, "velocities[1, 2] = 1e+200; kinetic energy"),
    ({"restitution": 1.5}, "restitution = 1.5; must lie in [0, 1]"),
    ({"restitution": [[1, 1], [1, -1]]}, "restitution[1, 1] = -1.0; must lie in [0, 1]"),
    ({"restitution": [1, 1, 1]}, "restitution has shape (3,); must be () or (..., 2) for 3 balls"),
    ({"forward": [[0.1], [7]]}, "forward[1, 0] = 7.0; must lie in [0, 1]"),
    ({"backward": [[0.1], [7]]}, "backward[1, 0] = 7.0; must lie in [0, 1]"),
    ({"masses": np.ones((2, 3)), "velocities": np.ones((3, 3))},
     "leading axes do not broadcast: masses (2, 3), velocities (3, 3)"),
    ({"restitution": np.ones((2, 2)), "forward": np.zeros((3, 1))},
     "leading axes do not broadcast: masses (3,), velocities (3,), restitution (2, 2)"),
    # A batch without a chain is checked all the same.
    ({"masses": np.ones((0, 3)), "velocities": [np.nan, 0, 0]}, "velocities[0] = nan; must be"),
    ({"masses": np.ones((0, 3)), "forward": 2}, "forward = 2.0; must lie in [0, 1]"),
    # Two balls have no ratio, but one is given.
    ({"masses": [1, 1], "velocities": [1, 0], "forward": 7}, "forward = 7.0; must lie in [0, 1]"),
]  # fmt: skip

#: Of a model, and of a batch.  Holding contacts at their bounds excuses no ratio outside 0 and 1.
RATIOS = [
    ({"forward": -0.1}, "forward = -0.1; must lie in [0, 1]"),
    ({"forward": [0.1, 1 + 1e-9]}, "forward[1] = 1.000000001; must lie in [0, 1]"),
    ({"forward": [0.1, NAN]}, "forward[1] = nan; must be finite"),
    ({"forward": None}, "forward = None; must be real numbers"),
    ({"forward": [[0.1]]}, "forward has shape (1, 1); must be () or (N - 2,)"),
    ({"backward": [0.1, 2]}, "backward[1] = 2.0; must lie in [0, 1]"),
    ({"backward": -INF}, "backward = -inf; must be finite"),
    ({"backward": [[0.1]]}, "backward has shape (1, 1); must be () or (N - 2,)"),
    ({"meeting": -0.5}, "meeting = -0.5; must lie in [0, 1]"),
    ({"meeting": 1.5}, "meeting = 1.5; must lie in [0, 1]"),
    ({"meeting": [0.5]}, "meeting = [0.5]; must be one number"),
    ({"excess": "ignore"}, "excess = 'ignore'; must be 'raise' or 'saturate'"),
    ({"excess": np.array(["raise"])}, "excess = array(['raise'], dtype='<U5'); must be 'raise' or"),
    ({"max_events": 0}, "max_events = 0; must be a whole number, at least 1"),
    ({"max_events": 2**63}, f"max_events = {2**63}; must be a whole number, at least 1 and below"),
    ({"max_events": 1e6}, "max_events = 1000000.0; must be an int, at least 1 and below 2**63"),
    ({"max_events": True}, "max_events = True; must be a whole number"),
]

SHAPES = [
    (([1, 1], [1, 0, 0], [1, 1], 0), "masses has shape (2,); must be (..., 3)"),
    ((ONES, np.ones((3, 4)), [1, 1], 0), "velocities has shape (3, 4); must be (..., 3)"),
    ((ONES, [1, 0, 0], 1, 0), "restitution has shape (); must be (..., 2)"),
    ((ONES, [1, 0, 0], ONES, 0), "restitution has shape (3,); must be (..., 2)"),
    ((ONES, [1, 0, 0], [1, 1], "a"), "ratio = 'a'; must be real numbers"),
    ((np.ones((4, 3)), [1, 0, 0], [1, 1], [0, 0.1]), "leading axes do not broadcast: masses (4, 3"),
]

BOUNDS = [
    ((1, 0.5, 0.5), "masses has shape (); must be (..., N) with N >= 2"),
    ((ONES, [[0.5]], [0.5, 0.5]), "backward has shape (2,); must be () or (..., 1) for 3 balls"),
    (
        ([ONES] * 2, [[0.5]] * 3, 0.5),
        "leading axes do not broadcast: masses (2, 3), forward (3, 1)",
    ),
    (([1, 0, 1], [0.5], [0.5]), "masses[1] = 0.0; must be above 0"),
    (([1, 1, INF], [0.5], [0.5]), "masses[2] = inf; must be finite"),
    ((ONES, [-0.1], [0.5]), "forward[0] = -0.1; must lie in [0, 1]"),
    ((ONES, [0.1], [[0.5], [1.5]]), "backward[1, 0] = 1.5; must lie in [0, 1]"),
]

LETTERS = [
    ("ABXA", "sequence[2] = 'X'; must be one of A, B, C, D"),
    (["A", "BC"], "sequence[1] = 'BC'; must be one of A, B, C, D"),
    ([1, 2], "sequence[0] = 1; must be one of A, B, C, D"),
    ("", "sequence = ''; must name at least 2 balls"),
    ("ABC" * 99 + "ABx", "sequence[299] = 'x'; must be one of A, B, C, D"),
]

#: Of a `SpringChain`, and of `spring_velocities` but for the last one.
SPRINGS = [
    ({"stiffness": [1, 0]}, "stiffness[1] = 0.0; must be above 0"),
    ({"stiffness": [1, 1e-10]}, "stiffness[1] = 1e-10; must be at least 1e-09 of the stiffest"),
    ({"exponent": 0.9}, "exponent = 0.9; must lie in [1, 10]"),
    ({"viscosity": [0.1, -0.1]}, "viscosity[1] = -0.1; must be at least 0"),
    ({"viscosity": 50.0},
     "viscosity[0] = 50.0; must be at most 7.58 s, 10 (m u^2 / k)^(1 / 2.5) / u"),
    ({"gaps": 1e12}, "gaps[0] = 1000000000000.0; must at this accuracy be at most 1"),
    ({"gaps": [0, 3e7], "accuracy": 1e-6},
     "gaps[1] = 30000000.0; must at this accuracy be at most 1e+07 times 0.758 m"),
    ({"gaps": [0, 1e-20]}, "gaps[1] = 1e-20; must be 0, or 1e-12 of 0.758 m, that is (m u^2"),
    ({"gaps": [0, -3]}, "gaps[1] = -3.0; must be a lean of at most 0.758 m, that is (m"),
    ({"accuracy": 1e-13}, "accuracy = 1e-13; must lie in [1e-12, 0.02]"),
    ({"max_steps": 0}, "max_steps = 0; must be a whole number, at least 1"),
]  # fmt: skip

LAWS = [
    (SequentialCollisions, ("first",), "order = 'first'; must be 'left' or 'right'"),
    (SequentialCollisions, {"max_events": 0}, "max_events = 0; must be a whole number, at"),
    *(
        (struck, (FusedChain(), [1] * 4, v), f"{UNDEFINED}{what} FusedChain needs")
        for v, what in (
            ([2, 1, 0, 0], "[0, 1] approach;"),
            ([1, 0, 0, 0.5], "[0] approach and [2] open;"),
            ([0, 1, 0, 0], "[1] approach and [0] open;"),
        )
    ),
    (SpeedDependent, (SequentialCollisions(), 0.9), "restitution = 0.9; must be a law e(u)"),
    (ConstantLoss(0.1), (0,), "u = 0.0; must be above 0"),
    (ViscousLoss(1e-6, masses=[1, 1], stiffness=1e9), (-1,), "u = -1.0; must be above 0"),
    *(
        (ViscousLoss, {"viscosity": 0, "stiffness": 1, "masses": masses}, f"masses{words}")
        for masses, words in (
            ([1, 2, 1], " has 3 values; 2 balls need 2, or one number"),
            ([1, -1], "[1] = -1.0; must be above 0"),
            ([1, 1e-200], "[1] = 1e-200; must be at least 1e-150 of the heaviest"),
        )
    ),
    (SpeedDependent, (3, ConstantLoss(0.1)), "model is an int; must be an impact model"),
    *(
        (struck, (SpeedDependent(SequentialCollisions(), law),), f"restitution(u)[0] = {words}")
        for law, words in (
            (lambda _: 1.5, "1.5; must lie in"),
            (lambda _: NAN, "nan; must be"),
            (lambda _: "a", "'a'; must be a real"),
        )
    ),
    (struck, (SpeedDependent(SequentialCollisions(), ConstantLoss(0.1)), ONES, [1, 0, 0], 0.9),
     "restitution[0] = 0.9; must be 1: SpeedDependent has its own"),
    (EnergyDistribution, (-1,), "stiffness = -1.0; must be above 0"),
    (EnergyDistribution, (1, 0.5), "exponent = 0.5; must be at least 1"),
    (EnergyDistribution, {"rtol": 0}, "rtol = 0.0; must lie in"),
    (EnergyDistribution, {"max_evaluations": 0}, "max_evaluations = 0; must be a whole number, at"),
    (struck, (EnergyDistribution([1, 2, 3]),), "stiffness has 3 values; 3 balls need 2"),
    *(
        (struck, (model, [mass] * 3, [1e-10, 0, 0]), f"masses[0] = {mass!r}; its reduced mass with "
         f"masses[1] = {mass!r} is beyond the range")
        for model in (SpringChain(), EnergyDistribution()) for mass in (5e-324, 1e-309, 1.2e308)
    ),
    (QuadraticDissipation, (-1,), "coefficients = -1.0; must lie in [0, 1e+09]"),
    (QuadraticDissipation, ([1, np.inf],), "coefficients[1] = inf; must be finite"),
    (QuadraticDissipation, {"max_problems": 0}, "max_problems = 0; must be a whole number, at le"),
    (struck, (QuadraticDissipation(), ONES, [1, 0, 0], [0.5, 1]),
     "restitution[1] = 1.0; must be below 1 - 2e-09 for QuadraticDissipation: e = 1 is a limit"),
    (struck, (QuadraticDissipation([1, 2, 3]),), "coefficients has 3 values; 3 balls need 2, or o"),
    (struck, (QuadraticDissipation(), [1, 1e-100, 1], [1, 0, 0], 0.5),
     "masses[1] = 1e-100; must be at least 1e-06 of the he"),
    # A group: each is near a neighbour, but the group is far from both its sides.
    (struck, (QuadraticDissipation(), [1e4, 1e-15, 2e-15, 1e13, 1e4], [1, 0, 0, 0, 0], 0.5),
     "masses[1] = 1e-15; must be at least 1e-06 of the he"),
]  # fmt: skip

SWINGS = [
    ({"positions": [0.01, 0, 0]}, "positions = [0.01, 0.0, 0.0]; balls 0 and 1 overlap by 0.01"),
    ({"positions": [0, 0]}, "positions has shape (2,); 3 balls need (3,)"),
    ({"times": [1, 0]}, "times = [1, 0]; must be a row of rising"),
    ({"times": []}, "times = []; must be a row of rising"),
    ({"max_impacts": 0}, "max_impacts = 0"),
    ({"model": SpringChain(gaps=1e-6)}, "model.gaps = 1e-06; must be 0: those of a swing are"),
    ({"model": ImpulseCorrelation([0.1] * 4)}, "forward has 4 values; 3 balls need 1"),
    ({"pendulums": Pendulums(1, damping=4)},
     "damping[0] = 4.0; must be below the natural frequency sqrt(g/l) = 3.13"),
    ({"positions": [0, 0, 0.2], "pendulums": Pendulums([1, 1, 0.1])},
     "positions[2] = 0.2; must be within 0.1571 m: "),
    ({"positions": [-0.2, 0, 0], "pendulums": Pendulums(0.1, gaps=1e-3, angle="full")},
     "positions[0] = -0.2; must be within 0.1571 m: pendulums of this length reach a quarter of"),
]  # fmt: skip

PENDULUMS = [
    ({"length": 0}, "length = 0.0; must be above 0"),
    ({"gaps": [0, -1]}, "gaps[1] = -1.0; must be at least 0"),
    ({"damping": -1}, "damping = -1.0"),
    ({"gravity": 0}, "gravity = 0.0"),
    ({"angle": "large"}, "angle = 'large'"),
    ({"angle": "full", "length": [1, 2]}, "length = (1.0, 2.0); must be equal with angle='full'"),
]

NO_MODELS = [
    (ImpulseCorrelation, "model is the class ImpulseCorrelation; must be made: ImpulseCorre"),
    (0.5, "model is a float; must be an impact model"),
    ([0.1], "model is a list; must be an impact model"),
    (None, "model is a NoneType; must be an impact model"),
]

ADVICE = [
    (THREE, {}, "wanted = 'velocities'; needs ratios or stiffness: restitution alone does not det"),
    (THREE, {"wanted": "forces"}, "wanted = 'forces'; needs stiffness"),
    (THREE, {"wanted": ("path", "times"), "ratios": 0.1}, "wanted = 'times'; needs stiffness"),
    (LOSSY, {"wanted": "forces"}, "wanted = 'forces'; needs stiffness"),
    (LOSSY, {"model_error": 0.1}, "model_error = 0.1, restitution[0] = 0.9; must be left out"),
    (THREE, {"accuracy": 2e-15, "stiffness": 1}, "accuracy = 2e-15; the least numerical error of"),
    (LOSSY, {"accuracy": 1e-15, "stiffness": 1}, "accuracy = 1e-15; the least numerical error of"),
    (THREE, {"model_error": 1e-6}, "model_error = 1e-06; that of SequentialCollisions is 0."),
    (THREE, {"model_error": 1e-6, "ratios": 0.2, "accuracy": 2e-15}, "model_error = 1e-06; that o"),
    (THREE, {"model_error": -1}, "model_error = -1.0; must lie in [0, 1]"),
    (THREE, {"wanted": "speed"}, "wanted = 'speed'; must be one of velocities, impulses"),
    (THREE, {"wanted": ["path", 3]}, "wanted = 3; must be one of"),
    (THREE, {"impacts": 0, "ratios": 0.1}, "impacts = 0; must be a whole number, at least 1"),
    (THREE, {"ratios": 0.6}, "forward[0] = 0.6; at ball 1, counted from 0, it must not exceed 0.5"),
    (THREE, {"ratios": [0.1, 0.1]}, "forward has 2 values; 3 balls need 1, or one number"),
    (THREE, {"stiffness": [1, 2, 3]}, "stiffness has 3 values; 3 balls need 2"),
    (Chain([1, 1, 1], [0, 0, 1]), {}, "velocities = [0.0, 0.0, 1.0]; no balls approach"),
]

OTHERS = [
    (back_impact_line, (1, 0, 0.5, 0.1), "e2 = 0.0; must lie in [1e-30, 1]"),
    (back_impact_line, ([1, -1], 0.5, 0.5, 0.1), "r2[1] = -1.0; must be at least 0"),
    (back_impact_line, (1, 0.5, 1.5, 0.1), "e3 = 1.5; must lie in [0, 1]"),
    (first_ball_stops, (0, 0.1), "e2 = 0.0; must lie in [1e-30, 1]"),
    (first_ball_stops, (0.5, 1.1), "ratio = 1.1; must lie in [0, 1]"),
    (middle_ball_stops, (-0.5, 0.1), "e3 = -0.5; must lie in [0, 1]"),
    (bouncing_pattern, ([1.0, 2.0],), "velocities has shape (2,); must be (..., 3)"),
    (bouncing_pattern, ([0.0, NAN, 1.0],), "velocities[1] = nan; must be finite"),
    (bouncing_pattern, ([-3.0, -2.0, -1.0],), "velocities of ball 3 = -1.0; must be at least 0"),
    (bouncing_pattern, ([[0, 0, 1], [-2, -2, -1]],), "velocities of ball 3[1] = -1.0"),
    (condition_number, (THREE, ImpulseCorrelation([0.1] * 3)), "forward has 3 values"),
    (effective_ratio, (THREE,), "trace is a Chain; must be a Trace"),
    (effective_ratio, ([1, 0, 0],), "trace is a list; must be a Trace"),
    (effective_ratio, (Trace,), "trace is the class Trace; must be a Trace"),
    (ratio_of, ([1, 0, 0, 0],), "trace has 4 balls; an effective ratio is that of three"),
    (ratio_of, ([0, 0, 1],), "closing_speeds = [0.0, -1.0]; any ratio fits"),
    (paper_chain, ("ABC", [1, 2]), "speed = [1, 2]; must be one number"),
    (paper_chain, (3,), "sequence is an int; must be letters, as in 'ABC'"),
    (paper_chain, (np.array("ABC"),), "sequence is a ndarray; must be letters, as in 'ABC'"),
    (viscosity, ([1, 1, 1], 0.01), "restitution = 0.01; must lie in [0.014, 1]: less takes"),
    (viscosity, ([1, 1, 1], [0.9, 1.1]), "restitution[1] = 1.1; must lie in [0.014, 1]"),
    (viscosity, ([1, 1, 1], [0.9] * 3), "restitution has shape (3,); must be () or (..., 2)"),
    (viscosity, ([1, 1], 0.9, 0), "speed = 0.0; must be above 0"),
    (viscosity, (1, 0.9), "masses has shape (); must be (..., N) with N >= 2"),
    (hertz_stiffness, ([1],), "radii has shape (1,); must be (..., N), of two balls or more"),
    (hertz_stiffness, ([1, 0],), "radii[1] = 0.0; must be above 0"),
    (hertz_stiffness, ([1, 1], 1, 0.6), "poisson = 0.6; must be above -1 and at most 0.5"),
    (viscosity, ([1, 1], 0.9, 1, 0), "stiffness = 0.0; must be above 0"),
    (spring_velocities, (ONES, [1, 0, 0], ONES), "stiffness has shape (3,); must be () or (..., 2"),
    (collide, (THREE, SpringChain(ONES)), "stiffness has 3 values; 3 balls need 2"),
    (collide, (Chain(ONES, [1, 0, 0], [1, 0.5]), SpringChain()), "restitution[1] = 0.5; must be"),
    (collide, (Chain([1, 1e-10], [1, 0]), SpringChain()), "masses[1] = 1e-10; must be at least 1e"),
    (SpringChain, {"damping": "hunt"}, "damping = 'hunt'; must be 'viscoelastic' or 'hunt-crossle"),
    (spring_velocities, PAIR | {"damping": 1}, "damping = 1; must be 'viscoelastic' or 'hunt-cros"),
    (spring_velocities, PAIR | {"velocities": [4, 0], "viscosity": 3} | HUNT,
     "viscosity[0] = 3.0; must be at most 2.5 s/m, 10 over the speed of the fastest"),
    (viscosity_from, {"restitution": 0.05, "speed": 1, "masses": [1, 1]} | HUNT,
     "restitution = 0.05; must lie in [0.100, 1]"),
    (read_tracker, {"path": FILM, "unit": 0}, "unit = 0.0; must be above 0"),
    (read_tracker, {"path": FILM, "time_scale": 0}, "time_scale = 0.0; must be above 0"),
    *(
        (velocities_from_tracks, {"tracks": read_tracker(FILM), "striker": ball},
         f"striker = {ball}; must be a whole number, from 0 to 2")
        for ball in (1.5, -1, 3)
    ),
    (recommend, ([1, 1, 1],), "chain is a list; must be a Chain"),
    (TRACE.plot, {"contact": 4}, "contact = 4; must be a whole number, 0 to 1"),
    (velocity_impulse, {"trace": TRACE, "contact": -1}, "contact = -1; must be a whole number"),
    (animate_swing, ([],), "runs has no swing, or one without a duration"),
    (animate_swing, (RUN, ["a", "b"]), "labels has 2 lines; 1 swings need as many"),
]  # fmt: skip


def rows():
    """Every call that is refused: what is called, with what, and the words."""
    yield from ((chain, given, words) for given, words in CHAINS)
    one = {"masses": [1, 1, 1], "velocities": [1, 0, 0], "restitution": 1, "forward": 0.1}
    yield from ((post_impact_velocities, one | change, words) for change, words in BATCH)
    for change, words in RATIOS:
        asked = {"forward": 0.1, "excess": "saturate"} | change
        yield ImpulseCorrelation, asked, words
        words = words.replace("(N - 2,)", "(..., 2) for 4 balls")
        batch = {"masses": np.ones(4), "velocities": [1, 0, 0, 0], "restitution": 1}
        yield post_impact_velocities, batch | asked, words
    for function in (three_balls, final_impulses, one_collision_each):
        yield from ((function, given, words) for given, words in SHAPES)
    yield from ((largest_ratios, given, words) for given, words in BOUNDS)
    yield from ((paper_chain, (given,), words) for given, words in LETTERS)
    swung = {"chain": THREE, "model": ImpulseCorrelation(0.1), "positions": ONES * 0, "times": [1]}
    yield from ((swing, swung | change, words) for change, words in SWINGS)
    yield from ((Pendulums, given, words) for given, words in PENDULUMS)
    yield from ((springs, options, words) for options, words in SPRINGS)
    leans = {"gaps": [[0, 0], [0, -3]]}, "gaps[1, 1] = -3.0; must be a lean"
    faint, slow = {"masses": 1e-323 * ONES}, {"velocities": [1e-301, 0, 0], "exponent": 1}
    beyond = "masses[0] = 1e-323; its reduced mass with masses[1] = 1e-323 is beyond the range of"
    huge = {"masses": 1.2e308 * ONES, "velocities": [1e-10, 0, 0]}
    sums = beyond.replace("1e-323", "1.2e+308")
    late = "stiffness[0] = 1.0; its time is beyond floats: choose other units"
    for options, words in (*SPRINGS[:-1], leans, (faint, beyond), (huge, sums), (slow, late)):
        yield spring_velocities, {"masses": ONES, "velocities": [1, 0, 0], **options}, words
    for call in (collide, condition_number):
        yield from ((call, (THREE, thing), words) for thing, words in NO_MODELS)
    yield from ((recommend, {"chain": one, **asked}, words) for one, asked, words in ADVICE)
    for masses in ([1, 1e-20], [1e-20, 1], [1, 1, 1e-20], [1, 1e-16, 1]):
        words = f"masses[{masses.index(min(masses))}] = {min(masses)}; for this model it must be at"
        yield from ((light, (masses, door), words) for door in ("collide", "batch"))
    for number in (0, -1, 1.5):
        given = {"runs": RUN, "columns": number}
        yield animate_swing, given, f"columns = {number}; must be a whole number, at least 1"
    yield from LAWS + OTHERS


@pytest.mark.parametrize(
    ("function", "given", "words"),
    [pytest.param(*row, id=f"{getattr(row[0], '__name__', row[0])}: {row[2]}") for row in rows()],
)
def test_refused_in_these_words(function, given, words):
    named, no_such = isinstance(given, dict), re.match(r"\w+ is (an?|the) |.* a law", words)
    kind = TypeError if no_such else ValueError
    with pytest.raises(kind, match="^" + re.escape(words)):
        function(**given) if named else function(*given)
