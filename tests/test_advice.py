"""Recommendations: kept by the recommended model on chains of its own, or refused in words.

No number of the measured table stands here, because it is measured anew from time to time.
"""

import re
import xml.etree.ElementTree as ElementTree

import gaps
import numpy as np
import pytest
from chains import ELASTIC, HERTZ, magnitudes, striking, uniform, within_bounds
from dop853 import integrated
from energy_law import strike
from problem import Problem
from stored import read
from truth import in_fifty_digits

import cradle.advice.choice
import cradle.advice.measured
from cradle import (
    Chain,
    EnergyDistribution,
    ImpulseCorrelation,
    SequentialCollisions,
    SpringChain,
    collide,
    paper_chain,
    post_impact_velocities,
    recommend,
    viscosity_from,
)
from cradle.advice.choice import lasting
from cradle.advice.measured import evidence, measured_chain, rows

#: Numbers of the table may come from another version of SciPy, and errors near rounding vary.
SLACK, ROUNDING = 2.0, 2.0**-50
LOSSY, LOST = (Chain([1, 1, 1], [1, 0, 0], e) for e in (0.9, 0.01))
#: Its last contact is slower than the first by far: for its restitution springs have no viscosity.
HEAVY = Chain([1, 1, 3000, 3000], [1, 0, 0, 0], [0.9, 0.9, 0.4])
THREE, FIVE, LIGHT = (striking(ELASTIC[name]) for name in ELASTIC)
ABCCA, TABLES = paper_chain("ABCCA", excess="saturate")


def off(chain, advice, answer):
    """Error of the recommended model, over the closing speed."""
    u = np.abs(chain.closing_speeds).max()
    return np.abs(collide(chain, advice.model).velocities - answer).max() / u


def between(number, spread, seed=7):
    """Masses of three to five balls, and the numbers they were drawn from."""
    rng = np.random.default_rng(seed)
    for k in range(number):
        yield 1.0 + (spread - 1.0) * rng.random((3, 4, 5)[k % 3]), rng


# --- what was promised is kept ------------------------------------------------------------------


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("name", ELASTIC)
def test_the_cheapest_setting_of_the_table(name, accuracy):
    """Springs against velocities from another program, too; its last digit is the ninth."""
    chain = striking(ELASTIC[name])
    advice = recommend(chain, accuracy=accuracy, stiffness=1.0)
    measured = read("benchmarks.csv", group="springs", model="SpringChain, Hertz", chain=name)
    fit = [row for row in measured if float(row["numerical_error"]) <= accuracy]
    row = min(fit, key=lambda row: float(row["time_ratio"]))
    assert advice.setting == row["setting"]
    assert advice.numerical_error == float(row["numerical_error"])
    assert advice.seconds == pytest.approx(1e-6 * float(row["microseconds"]), rel=0.5)
    assert advice.measured_on == (name,)
    setting = float(row["setting"].replace(",", "").split()[1])
    assert advice == recommend(chain, accuracy=accuracy, stiffness=1.0, model_error=0.0)
    assert advice.model == SpringChain(1.0, accuracy=setting)
    assert off(chain, advice, HERTZ[name]) <= SLACK * advice.numerical_error + 1e-9


def test_springs_among_the_measured_chains():
    """Against spheres by steps of our own, which are finer than what is asked."""
    for m, _ in between(4, 3.0):
        struck = m, np.eye(len(m))[0], 1, 0
        answer, finer = (gaps.strike(*struck, step=h, longest=500) for h in (0.02, 0.01))
        own = np.abs(answer - finer).max()
        assert own < 2e-5
        for accuracy in (1e-2, 1e-4):
            advice = recommend(striking(m), accuracy=accuracy, stiffness=7.0)
            assert advice.measured_on == ("three equal", "five equal", "light middle")
            assert off(striking(m), advice, finer) <= accuracy + own
            assert advice.numerical_error * 10 <= accuracy
    for m, _ in between(6, 60.0, seed=8):
        other = collide(striking(m), SpringChain(1.0, accuracy=1e-12)).velocities
        for accuracy in (1e-3, 1e-5, 1e-7):
            advice = recommend(striking(m), accuracy=accuracy, stiffness=1.0)
            assert off(striking(m), advice, other) <= accuracy


def test_forces_and_times_are_no_worse_than_said():
    """Their errors were not measured; the notes say so.  Of three balls they can be looked at."""
    best = collide(THREE, SpringChain(1.0, accuracy=1e-12))
    for accuracy in (1e-3, 1e-6):
        model = recommend(THREE, ("forces", "times"), accuracy=accuracy, stiffness=1.0).model
        trace = collide(THREE, model)
        peaks, others = (one.forces.max(axis=0) for one in (trace, best))
        np.testing.assert_allclose(peaks, others, rtol=20 * accuracy)
        np.testing.assert_allclose(trace.durations, best.durations, rtol=20 * accuracy)


def test_events_against_fifty_digits():
    """On all measured chains, and on random ones among them, each with ratios of its own."""
    given = [(one, ImpulseCorrelation(0.167)) for one in (THREE, FIVE, LIGHT)] + [(ABCCA, TABLES)]
    for m, rng in between(8, 90.0):
        e = uniform(rng, 0.3, 1.0, len(m) - 1)
        given.append((striking(m, e), ImpulseCorrelation(*within_bounds(m, rng.random))))
    for chain, ratios in given:
        advice = recommend(chain, "path", ratios=ratios, accuracy=1e-12)
        assert (advice.model, advice.call) == (ratios, "collide(advice.chain, advice.model)")
        answer = in_fifty_digits(*Problem.of(chain, ratios)[:5])
        assert advice.numerical_error * (1 if len(advice.measured_on) == 1 else 10) <= 1e-12
        assert off(chain, advice, answer) <= 10 * advice.numerical_error + ROUNDING


def test_losses_and_no_ratios():
    """Against small steps of time, and at more digits against a finer tolerance."""
    advice = recommend(HEAVY, "impulses", accuracy=1e-3, stiffness=1.0)
    assert isinstance(advice.model, EnergyDistribution)
    balls = HEAVY.masses, HEAVY.velocities, HEAVY.restitution
    steps = [strike(*balls, count)[0] for count in (1000, 2000)]
    answer, own = 2 * steps[1] - steps[0], np.abs(steps[1] - steps[0]).max()
    assert own < 1e-3
    assert off(HEAVY, advice, answer) <= 1e-3 + own
    for m, rng in between(4, 1.15):
        chain = striking(m, [0.01, *uniform(rng, 0.3, 1.0, len(m) - 2)])
        finer = collide(chain, EnergyDistribution(rtol=1e-12)).velocities
        for accuracy in (1e-2, 1e-5):
            advice = recommend(chain, accuracy=accuracy, stiffness=1.0)
            assert off(chain, advice, finer) <= accuracy
            assert advice.model_error is None


def test_losses_that_viscous_springs_can_have():
    """Forces too; each pair alone parts with its restitution.  By SciPy's integrator."""
    paper = paper_chain("ABCCA", speed=0.3)[0]
    given = [(m, uniform(rng, 0.85, 1.0, len(m) - 1)) for m, rng in between(6, 5.0)]
    for m, e in [*given, (paper.masses, paper.restitution)]:
        chain = striking(m, e, 0.3)
        loss = viscosity_from(e, speed=0.3, masses=m, stiffness=50.0)
        answer = integrated(m, chain.velocities, k=50.0, loss=loss)
        for accuracy in (1e-2, 1e-4):
            wanted = "velocities" if accuracy == 1e-2 else ("forces", "times")
            advice = recommend(chain, wanted, accuracy=accuracy, stiffness=50.0)
            assert advice.model == SpringChain(50.0, viscosity=loss, accuracy=advice.model.accuracy)
            after = eval(advice.call).velocities
            assert np.abs(after - answer).max() <= 0.3 * accuracy
            around = "five lossy" in advice.measured_on
            assert (advice.model_error, around) == (None, m is not paper.masses)
            assert not around or advice.numerical_error * 10 <= accuracy
    five = striking([1] * 5, 0.02)
    law = recommend(five, stiffness=1)
    springs, energy = collide(law.chain, law.model), collide(five, EnergyDistribution())
    apart = f"balls by {springs.velocities[-1] - energy.velocities[-1]:.2f} of the closing speed"
    assert apart.replace("0.", ".") in recommend(striking([1] * 5, 0.01), stiffness=1).reason
    with pytest.raises(ValueError, match=r"restitution\[0\] = 0.01; must lie in \[0.014, 1\]"):
        recommend(LOST, "forces", stiffness=1)
    with pytest.raises(ValueError, match=r"viscosity\[2\] = .*; must be at most"):
        recommend(HEAVY, "forces", stiffness=1)


@pytest.mark.parametrize("name", list(ELASTIC))
def test_model_errors(name):
    """Of what restitution alone allows, and of the measured ratio: from the other program."""
    chain = striking(ELASTIC[name])
    for known, kind in (({}, SequentialCollisions), ({"ratios": 0.167}, ImpulseCorrelation)):
        advice = recommend(chain, model_error=0.5, **known)
        assert isinstance(advice.model, kind)
        assert advice.model_error == pytest.approx(off(chain, advice, HERTZ[name]), abs=1e-4)
        with pytest.raises(ValueError, match=r"^model_error = .*; that of "):
            recommend(chain, model_error=advice.model_error / 100, **known)
        # Springs are what it is measured from.
        springs = recommend(chain, model_error=advice.model_error / 100, stiffness=1, **known)
        assert springs.model_error == 0.0


def test_sequential_is_the_nearest_that_needs_restitution_alone():
    """As its reason says, and the refusal of a bare chain tells how near."""
    worst = {}
    for row in read("benchmarks.csv", group="outcome", needs="e"):
        if row["model_reference"].startswith("Hertz"):
            error = float(row["model_error"])
            worst[row["model"]] = max(error, worst.get(row["model"], 0.0))
    assert min(worst, key=worst.get) == "SequentialCollisions"
    assert len(worst) > 1
    with pytest.raises(ValueError, match="needs ratios or stiffness") as refused:
        recommend(THREE)
    said = re.search(r"off by (\S+) to (\S+) of", str(refused.value))
    errors = [
        np.abs(collide(striking(m), SequentialCollisions()).velocities - HERTZ[name]).max()
        for name, m in ELASTIC.items()
    ]
    assert [float(x) for x in said.groups()] == pytest.approx([min(errors), max(errors)], rel=0.05)


def test_the_fastest_ball():
    """Right on the measured elastic chains, wrong on another one, as the reason warns."""
    for chain, answer in zip((THREE, FIVE, LIGHT), HERTZ.values(), strict=True):
        for known, kind in (({}, SequentialCollisions), ({"stiffness": 1.0}, SpringChain)):
            advice = recommend(chain, "fastest ball", **known)
            assert isinstance(advice.model, kind)
            assert len(advice.measured_on) == 1
            after = np.abs(collide(chain, advice.model).velocities)
            assert after.argmax() == np.abs(answer).argmax()
    assert isinstance(recommend(HEAVY, "fastest ball", stiffness=1).model, EnergyDistribution)
    chain = striking([1.0, 0.08, 2.16, 0.93, 0.84])
    advice = recommend(chain, "fastest ball")
    assert advice.measured_on == ()
    assert "on others it can be wrong" in advice.reason
    wrong = np.abs(collide(chain, advice.model).velocities).argmax()
    assert wrong != np.abs(gaps.strike(chain.masses, np.eye(5)[0], 1, 0)).argmax()
    # Whoever knows the stiffness is given springs there.
    assert isinstance(recommend(chain, "fastest ball", stiffness=1).model, SpringChain)


def test_scatter_of_times_does_not_choose_the_model(monkeypatch):
    """Each time may be a fifth more or less, as in another run: the same model is recommended."""
    asked = {"wanted": "fastest ball", "ratios": 0.167}
    measured, rng = cradle.advice.choice.rows, np.random.default_rng(8)

    def scattered(*group):
        return tuple(
            row._replace(seconds=row.seconds * uniform(rng, 0.8, 1.2)) for row in measured(*group)
        )

    models = [recommend(chain, **asked).model for chain in (THREE, FIVE, LIGHT)]
    monkeypatch.setattr(cradle.advice.choice, "rows", scattered)
    for _ in range(20):
        models += [recommend(chain, **asked).model for chain in (THREE, FIVE, LIGHT)]
    assert set(models) == {ImpulseCorrelation(0.167)}


def test_two_balls_need_no_ratio():
    rng = np.random.default_rng(5)
    for impacts in (1, 100):
        m, e = magnitudes(rng, 1, 2), uniform(rng, 0.3, 1.0)
        chain = Chain(m, [1.0, -0.5], e)
        advice = recommend(chain, impacts=impacts)
        impulse = (1 + e) * 1.5 / (1 / m[0] + 1 / m[1])
        newton = np.array([1.0, -0.5]) + np.array([-impulse, impulse]) / m
        assert off(chain, advice, newton) < 1e-14
        assert "restitution alone determines" in advice.reason
        assert (advice.numerical_error is None) == (impacts == 1)  # as the table has it
    assert recommend(Chain([1, 2], [1, 0])).model_error == 0.0


def test_many_impacts_go_into_one_call():
    one, many = (recommend(THREE, ratios=0.1, impacts=k) for k in (1, 1000))
    assert many.seconds < one.seconds
    assert "batch" in many.setting
    after = post_impact_velocities([[1, 1, 1]] * 3, [1, 0, 0], 1, many.model.forward)
    np.testing.assert_allclose(after, [collide(THREE, one.model).velocities] * 3, atol=1e-15)
    assert many.call.partition("(")[0] == "post_impact_velocities"
    forces = recommend(THREE, stiffness=1, impacts=1000)
    assert forces.call.startswith("spring_velocities(masses, velocities, advice.model.stiffness, ")
    unmeasured = recommend(striking([1] * 20), stiffness=1, impacts=1000)
    assert (unmeasured.call, unmeasured.seconds) == (forces.call, None)
    assert forces.seconds < recommend(THREE, stiffness=1).seconds
    # A batch keeps no path.
    paths = [recommend(THREE, "path", ratios=0.1, impacts=k) for k in (1, 1000)]
    assert paths[0] == paths[1]


# --- what is measured, and what is not ----------------------------------------------------------


@pytest.mark.parametrize(
    ("chain", "known"),
    [
        (striking([1] * 20), {"stiffness": 1.0}),
        (striking([1, 1e-4, 1]), {"stiffness": 1.0}),
        (Chain([1, 1, 1], [1, 0, -1]), {"stiffness": 1.0}),
        (Chain([1, 1, 1], [1, 0, 0.5]), {"stiffness": 1.0}),
        (THREE, {"stiffness": [1.0, 2.0]}),
        (striking([1] * 7, 0.9), {"stiffness": 1.0}),
        (striking([1] * 4, 0.2), {"stiffness": 1.0}),
        (striking([1] * 3, 0.1), {"ratios": 0.1}),
        (striking([1] * 30, 0.9), {"ratios": 0.1}),
    ],
    ids=str,
)
def test_outside_nothing_is_claimed(chain, known):
    advice = recommend(chain, **known)
    assert advice.numerical_error is advice.seconds is None
    assert advice.measured_on == ()
    elastic = isinstance(advice.model, SpringChain) and (chain.restitution == 1).all()
    assert advice.model_error == (0.0 if elastic else None)
    lines = re.findall(r"^  .*: +not measured$", repr(advice), flags=re.M)
    springs = isinstance(advice.model, SpringChain)
    assert len(lines) == 3 - springs - (advice.model_error == 0.0)
    assert ("1e-07 at most by its own estimate" in repr(advice)) == springs
    eval(advice.call, {**vars(chain), **vars(cradle), "advice": advice})


def test_units_direction_and_frame_do_not_matter():
    for known in ({"stiffness": 1.0}, {"ratios": 0.167}):
        here = recommend(FIVE, accuracy=1e-4, **known)
        for chain in (
            Chain([0.3] * 5, [0.2, 0, 0, 0, 0]),
            Chain([1] * 5, [0, 0, 0, 0, -1]),
            Chain([1] * 5, [3, 2, 2, 2, 2]),
        ):
            assert recommend(chain, accuracy=1e-4, **known) == here


def test_chains_have_the_names_of_the_benchmarks():
    scenes = pytest.importorskip("scenes")
    for name, scene in scenes.LOSSY.items():
        assert measured_chain(scene.chain) == name
    for name, scene in scenes.SCENES.items():
        assert measured_chain(scene.chain) == name
        assert measured_chain(scene.chain, scene.model) == name
        assert measured_chain(scene.chain, ImpulseCorrelation(0.01)) == ""
    mirrored = Chain(ABCCA.masses[::-1], -ABCCA.velocities[::-1], ABCCA.restitution[::-1])
    swapped = ImpulseCorrelation(TABLES.backward[::-1], TABLES.forward[::-1], excess="saturate")
    assert measured_chain(mirrored, swapped) == "ABCCA"
    assert measured_chain(mirrored, TABLES) == ""
    for balls in (2, 3, 6):
        m, v, e, *_ = scenes.random_chains(balls, 300)
        low, high = cradle.advice.measured._DRAWN[f"{balls} balls, random"]
        assert (v == np.eye(balls)[0]).all()
        for one in zip(m, v, e, strict=True):
            least, most = cradle.advice.measured._place(Chain(*one))
            assert (np.array(low) <= least).all()
            assert (most <= np.array(high)).all()
        assert (m.max(axis=1) / m.min(axis=1)).max() > 0.5 * high[1]
    known = {row.chains[0] for group in ("event", "springs", "energy") for row in rows(group)}
    assert known == {*scenes.SCENES, *scenes.LOSSY, *(f"{n} balls, random" for n in (2, 3, 6))}


def test_the_worst_of_the_chains_around_counts():
    springs = [row for row in rows("springs") if "lossy" not in row.chains[0]]
    where, settings = evidence(springs, striking([1, 2, 1, 1]))
    assert where == "around"
    for one in settings:
        same = [row for row in springs if row.setting == one.setting]
        assert one.chains == ("three equal", "five equal", "light middle")
        assert one.numerical_error == max(row.numerical_error for row in same)
        assert one.seconds == max(row.seconds for row in same)
    batches = tuple(row for row in rows("event") if "batch" in row.setting)
    _, (batch,) = evidence(batches, striking([1, 2, 1], 0.9))
    # One that reaches the chain alone tells more than all together.
    assert batch.chains == ("3 balls, random",)


def test_the_other_kernel_has_rows_of_its_own(monkeypatch):
    """Without numba the times are those of the plain loop, in one call; batches have none."""
    monkeypatch.setattr("cradle.runtime.compile.available", lambda: False)
    rows.cache_clear()
    try:
        plain = recommend(THREE, ratios=0.167, impacts=100)
        assert plain.setting == "plain, one call with its path"
    finally:
        rows.cache_clear()


# --- what is said -------------------------------------------------------------------------------


def test_what_is_shown():
    advice = recommend(THREE, "forces", accuracy=1e-3, stiffness=1e10)
    text = repr(advice)
    assert text.startswith("Recommendation: SpringChain(stiffness=10000000000.0, accuracy=")
    assert f"{advice.numerical_error:.1e}" in text
    assert advice.reason in text
    tree = ElementTree.fromstring(advice._repr_html_())  # well formed
    cells = {row[0].text: row[1].text for row in tree.iter("tr")}
    assert eval(cells["model"]) == advice.model
    assert cells["measured on"] == "three equal"
    assert cells["time"].startswith(f"{lasting(advice.seconds)} once compiled")
    assert "of the stiffness given" in advice.reason
    assert "any stiffness will do" in recommend(THREE, stiffness=1).reason
    times = [lasting(t) for t in (2.5e-7, 9.996e-4, 0.0123, 12.3)]
    assert times == ["0.25 us", "1 ms", "12 ms", "12 s"]


def test_a_time_of_compiled_code_says_so():
    words = f"{lasting(recommend(FIVE, ratios=0.167).seconds)} once compiled; small work runs in"
    assert words in repr(recommend(FIVE, ratios=0.167))
    assert "once compiled" in repr(recommend(FIVE, stiffness=1, accuracy=1e-3))
    assert "once compiled" not in repr(recommend(LOST, stiffness=1, accuracy=1e-3))


def test_refusals_say_what_to_give():
    """And what they say is enough."""
    with pytest.raises(ValueError, match="Give stiffness=1 if all contacts are equal spheres"):
        recommend(THREE)
    assert recommend(THREE, stiffness=1).numerical_error <= 1e-6
    with pytest.raises(ValueError, match="for two steel balls of radius 1 cm stiffness=1e10"):
        recommend(THREE, "forces")
    # Hertz: 4/3 E* sqrt(R*) of 200 GPa and 0.3; two equal balls halve the modulus and the radius.
    steel = 4 / 3 * (200e9 / (1 - 0.3**2) / 2) * (0.01 / 2) ** 0.5
    assert steel == pytest.approx(1e10, rel=0.1)
    with pytest.raises(ValueError, match="give stiffness=1 for springs, which have no model"):
        recommend(THREE, model_error=1e-6)
    for chain in (LOSSY, striking([1, 1.01, 1], 0.9)):
        with pytest.raises(ValueError, match=r"ask for .* or more") as refused:
            recommend(chain, accuracy=1e-15, stiffness=1)
        least = float(re.search(r"ask for (\S+) or more", str(refused.value)).group(1))
        assert recommend(chain, accuracy=least, stiffness=1).numerical_error <= least


def test_a_refusal_names_what_a_model_lacks_and_nothing_that_it_has():
    wanted = ("velocities", "impulses", "times")
    with pytest.raises(ValueError, match="ask for") as refused:
        recommend(THREE, wanted, accuracy=1e-15, ratios=0.1, stiffness=1e10, impacts=100)
    told = str(refused.value)
    assert "ImpulseCorrelation has no times, " in told
    assert "spring_velocities has no impulses and times; " in told
