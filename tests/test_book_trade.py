"""What the text of book/trade.ipynb says, from the stored table and by second routes.

The table is measured (benchmarks/run.py); its velocities are compared with answers from the
independent solver in truth.py, with closed formulas, and with converged springs from elsewhere.
"""

from pathlib import Path

import numpy as np
import pytest
from chains import ELASTIC, HERTZ
from chapters import Chapter, points
from measured_table import find, fused, marks, sequential, table
from stored import read
from truth import solve

from cradle import Chain, EnergyDistribution, ImpulseCorrelation, SpringChain, collide

ROOT = Path(__file__).parents[1]
CHAPTER = Chapter("trade")
IMPULSE_ENGINES = ("Chipmunk", "Box2D", "Bullet", "Rapier")
ENGINES = (*IMPULSE_ENGINES, "MuJoCo")


def engine(model, setting, chain):
    (row,) = find("engine", model=model, setting=setting, chain=chain)
    return row


def off(row, answer):
    return np.abs(row["velocities"] - answer).max()


def cost(rows, error, what="time_ratio"):
    """Least time, or another price, at which an error is reached."""
    return min(row[what] for row in rows if row["numerical_error"] <= error)


def test_times_are_medians_and_say_what_the_text_says():
    timed = [row for row in table() if row["time_ratio"] is not None]
    assert len(timed) > 150
    assert min(row["repeats"] for row in timed) >= 9
    unit = find("event", "compiled, batch", chain="3 balls, random")[0]
    assert 0.5 < unit["time_ratio"] < 2  # the reference itself, measured as a row
    calls = {
        how: find("event", f"{how}, one call with", chain="three equal")[0]["time_ratio"]
        for how in ("compiled", "plain")
    }
    assert calls["plain"] > calls["compiled"] > 3  # a call costs more than its impact


def test_fig_trade_cost_events_are_exact_at_a_fixed_price():
    exact = [row for row in find("event") if "float32" not in row["setting"]]
    stored = find("event", "float32")
    assert max(row["numerical_error"] for row in exact) < 1e-13
    assert 1e-9 < max(row["numerical_error"] for row in stored) < 1e-6
    assert cost(find("march", chain="three equal"), 1e-3) > 50


def test_fig_trade_cost_springs():
    verlet = find("penalty", "Verlet", model="penalty, Hertz")
    one_call = find("event", "compiled, one call", chain="three equal")
    assert cost(verlet, 1e-2) < min(row["time_ratio"] for row in one_call)
    assert cost(verlet, 1e-6) > 5 * cost(verlet, 1e-2)
    springs = find("springs", chain="three equal", model="SpringChain, Hertz")
    assert 1 < cost(springs, 2e-9) / cost(springs, 2e-3) < 1000
    # Of fourth order: six digits for ten times the steps to the power 6/4, and the runs before.
    assert cost(springs, 2e-9, "evaluations") < 100 * cost(springs, 2e-3, "evaluations")
    # The right panel: error control spends fewer evaluations than fixed steps on many digits.
    assert cost(springs, 1e-8, "evaluations") < cost(verlet, 1e-8, "evaluations")


@pytest.mark.parametrize("scheme", ["semi-implicit Euler", "velocity Verlet"])
def test_fig_trade_stiffness_two_sweeps_on_one_curve(scheme):
    by_step = find("penalty", scheme, model="penalty, linear")
    phase, error = np.log([[np.pi * r["parameter"], r["numerical_error"]] for r in by_step]).T
    rising = np.argsort(phase)
    compared = 0
    for row in find("stiffness", scheme):
        at = np.log(row["parameter"])
        if phase.min() <= at <= phase.max():
            expected = np.interp(at, phase[rising], error[rising])
            # The error hangs on where in a step a contact ends, so the curve is not smooth.
            assert abs(np.log(row["numerical_error"]) - expected) < np.log(2.5)
            compared += 1
    assert compared >= 5
    percent = [r["parameter"] for r in find("stiffness", scheme) if r["numerical_error"] <= 1e-2]
    assert 0.1 <= max(percent) <= 0.6


def test_steel_balls_contact_time_in_closed_form():
    """Two spheres: 3.218 (mu^2 / (k'^2 v))^(1/5) with the force k' x^(3/2) and k' = k."""
    mass, modulus = 0.045, 210e9 / (2 * (1 - 0.3**2))
    radius = (3 * mass / (4 * np.pi * 7800)) ** (1 / 3)
    k = 4 / 3 * modulus * np.sqrt(radius / 2)
    trace = collide(Chain([mass, mass], [1, 0], 1), SpringChain(k))
    deepest = (5 * (mass / 2) / (4 * k)) ** 0.4
    assert trace.durations[0] == pytest.approx(2.94327 * deepest, rel=1e-5)
    assert round(1e6 * trace.durations[0]) == 67
    # Stiffness does not change the outcome: what a softened chain keeps.
    for soft in (k, k / 274_520):
        v = collide(Chain([mass] * 3, [1, 0, 0], 1), SpringChain(soft)).velocities
        np.testing.assert_allclose(v, HERTZ["three equal"], rtol=0, atol=1e-8)


def test_fig_trade_engines_textbook_answers():
    """The table of letters: S within .01 of sequential, F of fused; all engines are measured."""
    rows = find("engine")
    assert {row["model"] for row in rows} == set(ENGINES)
    assert len(rows) == 5 * 2 * 3 * 6
    assert all(row["versions"] for row in rows)
    for row in find("engine", "refined"):  # the fair test
        if row["chain"].startswith("two"):
            assert row["model_error"] < 3e-3, (row["model"], row["setting"])
    for scene in (*ELASTIC, "ABCCA"):
        for name in IMPULSE_ENGINES:
            assert off(engine(name, "refined, apart", scene), sequential(scene)) < 0.01
        for name, placement in (
            ("Chipmunk", "pressed"), ("Box2D", "pressed"), ("Bullet", "pressed"),
            ("Box2D", "touching"), ("Bullet", "touching"),
        ):  # fmt: skip
            assert off(engine(name, f"refined, {placement}", scene), fused(scene)) < 0.01
        for placement in ("touching", "pressed"):
            row = engine("Rapier", f"refined, {placement}", scene)
            assert min(off(row, sequential(scene)), off(row, fused(scene))) > 0.01
    touching = [engine("Chipmunk", "refined, touching", scene) for scene in ELASTIC]
    assert off(touching[0], sequential("three equal")) < 0.01
    assert off(touching[2], fused("light middle")) < 0.01


def test_fig_trade_engines_rapier_and_mujoco():
    for how in ("default", "refined"):
        for placement in ("touching", "pressed"):
            row = engine("Rapier", f"{how}, {placement}", "three equal")
            assert row["energy_change"] == pytest.approx(-1 / 6, abs=1e-3)
            for scene in ("three equal", "five equal", "ABCCA"):
                striker = engine("Rapier", f"{how}, {placement}", scene)["velocities"][0]
                assert fused(scene)[0] < striker < sequential(scene)[0]
            ends = np.sort([fused("light middle"), sequential("light middle")], axis=0)
            light = engine("Rapier", f"{how}, {placement}", "light middle")["velocities"]
            assert ((light < ends[0]) | (light > ends[1])).all()
    for scene in ("three equal", "five equal"):
        row = engine("MuJoCo", "refined, pressed", scene)
        assert 0.01 < off(row, fused(scene)) < 0.1 < off(row, sequential(scene))


def test_a_heavier_middle_ball_brings_the_two_answers_together():
    """From twice the outer mass on; for a lighter one their distance goes up and down."""

    def distance(m):
        masses, v = np.array([1.0, m, 1.0]), np.array([1.0, 0.0, 0.0])
        while (v[:-1] > v[1:] + 1e-14).any():  # one pair after the other
            k = int(np.argmax(v[:-1] - v[1:]))
            pair = masses[k : k + 2]
            v[k : k + 2] = 2 * (pair @ v[k : k + 2]) / pair.sum() - v[k : k + 2]
        together = np.array([-m, 2.0, 2.0]) / (2.0 + m)  # balls 2 and 3 as one body
        return np.abs(v - together).max()

    heavy = [distance(m) for m in np.geomspace(2, 1e4, 200)]
    assert (np.diff(heavy) < 0).all()
    light = np.diff([distance(m) for m in np.geomspace(0.01, 2, 200)])
    assert (light > 0).any()
    assert (light < 0).any()


def test_fig_trade_engines_spread_and_none_like_hertz():
    for scene in (*ELASTIC, "ABCCA"):
        all_of = np.stack([row["velocities"] for row in find("engine", chain=scene)])
        assert np.ptp(all_of, axis=0).max() > 0.4
    nearest = min(
        off(row, HERTZ[scene]) for scene in ELASTIC for row in find("engine", chain=scene)
    )
    assert nearest > 0.05
    default = [r["time_ratio"] for r in find("engine", "default") if r["time_ratio"] is not None]
    assert min(default) > 1


def test_engines_energy_from_nowhere():
    rows = [row for row in find("engine") if row["chain"] in ELASTIC]
    for row in rows:
        m = np.array(ELASTIC[row["chain"]], float)
        assert row["energy_change"] == pytest.approx(m @ row["velocities"] ** 2 - 1, abs=2e-4)
        assert row["momentum_error"] < 1e-4
    default = [row for row in rows if row["setting"].startswith("default")]
    most, least = (pick(default, key=lambda r: r["energy_change"]) for pick in (max, min))
    assert most["model"] == "Bullet"
    assert most["energy_change"] > 1
    assert least["energy_change"] < -0.4
    refined = [row for row in rows if row["setting"].startswith("refined")]
    assert {r["model"] for r in refined if r["energy_change"] > 1e-3} == {"MuJoCo"}
    assert max(r["energy_change"] for r in rows if r["model"] == "Rapier") < 1e-5
    two = find("engine", "default", model="Bullet", chain="two equal, e = 1")
    assert max(row["energy_change"] for row in two) > 0.01


def test_fig_trade_engines_drawn():
    """The striker's velocity of every row of the table, in the line of its engine."""
    axes = CHAPTER.figures["fig-trade-engines"].axes
    for ax, scene in zip(axes, (*ELASTIC, "ABCCA"), strict=True):
        expected = sorted(
            (row["velocities"][0], ENGINES.index(row["model"]) + 0.22 * at)
            for row in find("engine", chain=scene)
            for at, placement in zip((-1, 0, 1), ("apart", "touching", "pressed"))
            if row["setting"].endswith(placement)
        )
        np.testing.assert_allclose(sorted(map(tuple, marks(ax))), expected, rtol=0, atol=1e-12)
        filled = [line for line in ax.get_lines() if line.get_markerfacecolor() != "none"]
        refined = find("engine", "refined", chain=scene)
        assert sum(len(line.get_xdata()) == 1 for line in filled) == len(refined)
        verticals = {line[0, 0] for line in points(ax, 2)}
        for answer in (sequential(scene), fused(scene)):
            assert min(abs(x - answer[0]) for x in verticals) < 1e-12
        if scene in ELASTIC:
            assert min(abs(x - HERTZ[scene][0]) for x in verticals) < 1e-8


def test_fig_trade_cost_drawn():
    (ax,) = CHAPTER.figures["fig-trade-cost"].axes
    chosen = [
        find("march", chain="three equal"),
        find("penalty", "Verlet", model="penalty, Hertz"),
        find("springs", "accuracy", chain="three equal", model="SpringChain, Hertz"),
        find("energy", "rtol", chain="three equal"),
    ]
    drawn = [line for line in points(ax) if len(line) > 1]
    for line, found in zip(drawn, chosen, strict=True):
        expected = sorted((row["time_ratio"], row["numerical_error"]) for row in found)
        # The unit of time: within the scatter of its own measurements.
        unit = line[:, 0].min() / expected[0][0]
        assert 1e6 * unit == pytest.approx(
            np.median([r["microseconds"] / r["time_ratio"] for r in table() if r["time_ratio"]])
        )
        line = sorted(map(tuple, line / [unit, 1]))
        np.testing.assert_allclose(line, expected, rtol=1e-12)
    stars = sorted(x for x, _ in marks(ax))
    settings = ("compiled, batch", "compiled, one call with", "plain, one call with")
    ratios = [find("event", text, chain="three equal")[0]["time_ratio"] for text in settings]
    np.testing.assert_allclose(np.array(stars) / stars[0], np.array(ratios) / ratios[0])


def test_fig_trade_stiffness_drawn():
    columns = "numerical_error", "energy_change"
    for ax, column in zip(CHAPTER.figures["fig-trade-stiffness"].axes, columns):
        drawn = [np.array(sorted(map(tuple, line))) for line in points(ax)]
        for scheme in ("semi-implicit Euler", "velocity Verlet"):
            for rows, factor in (
                (find("penalty", scheme, model="penalty, linear"), np.pi),
                (find("stiffness", scheme), 1),
            ):
                expected = np.array(sorted((factor * r["parameter"], abs(r[column])) for r in rows))
                assert any(
                    line.shape == expected.shape and np.allclose(line, expected, rtol=1e-12, atol=0)
                    for line in drawn
                )


def test_fig_trade_models():
    measured, fitted = ImpulseCorrelation(0.167), ImpulseCorrelation(0.132503287)
    (ax,) = CHAPTER.figures["fig-trade-models"].axes
    errors = {}
    for line, scene in zip(points(ax), ELASTIC, strict=True):
        m = ELASTIC[scene]
        chain, answer = Chain(m, [1] + [0] * (len(m) - 1), 1), np.array(HERTZ[scene])
        found = [
            collide(chain, model).velocities
            for model in (EnergyDistribution(1.0), fitted, measured, SpringChain(1.0, 1))
        ]
        # The last one is the limit of the convex problem.
        found += [sequential(scene), fused(scene), fused(scene)]
        errors[scene] = np.abs(np.array(found) - answer).max(axis=1)
        np.testing.assert_allclose(line[:, 0], errors[scene], rtol=0, atol=1e-6)
        assert errors[scene][0] < 1e-8
        assert 0.5 < errors[scene][5] < 0.7
        assert errors[scene][2] < errors[scene][4]
        for group, model, k in (
            ("outcome", {"model": "SequentialCollisions"}, 4),
            ("outcome", {"model": "FusedChain"}, 5),
            ("event", {}, 2),
        ):
            for row in find(group, chain=scene, **model):
                assert row["model_error"] == pytest.approx(errors[scene][k], abs=1e-4)
    # One measured number takes most of the error away, for three and for five balls.
    for scene in ("three equal", "five equal"):
        assert errors[scene][2] < 0.4 * errors[scene][4]
    assert errors["three equal"][1] < 1e-8
    assert 0.04 < errors["five equal"][1] < 0.06
    assert errors["light middle"][1] > 0.2


def test_savings_are_savings():
    rows = find("saving")
    pairs = [rows[k : k + 2] for k in range(0, len(rows), 2)]
    assert len(pairs) == 5
    for full, less in pairs:
        assert full["model"] == less["model"]
        assert full["setting"].startswith("all: ")
        assert less["setting"].startswith("less: ")
        assert full["numerical_error"] < 1e-13
        assert less["time_ratio"] < full["time_ratio"], full["model"]
    line, three = pairs[-1]
    assert "1000" in line["setting"]
    assert line["time_ratio"] < 10 * three["time_ratio"]  # 333 times as many balls


def test_fig_trade_total_drawn():
    """Each panel is the stored table; the rule's error by another program, no error above asked."""
    rows = read("forces.csv")
    names = ("5 equal", "20 equal", "1 1 .1 1 1")
    for ax, name in zip(CHAPTER.figures["fig-trade-total"].axes, names, strict=True):
        for line, method in zip(
            points(ax), ("this package", "velocity Verlet", "the paper's rule"), strict=True
        ):
            found = [r for r in rows if (r["chain"], r["method"]) == (name, method)]
            expected = [(float(r["microseconds"]), float(r["error"])) for r in found]
            np.testing.assert_allclose(line, expected)
            assert all(float(r["error"]) <= float(r["asked"] or 1) for r in found)
    rule = next(r for r in rows if r["chain"] == "5 equal" and r["method"].startswith("the"))
    exact = [float(v) for v in solve([1] * 5, [1, 0, 0, 0, 0], [1] * 4, 0.132503287).velocities]
    assert float(rule["error"]) == pytest.approx(
        np.abs(np.subtract(exact, HERTZ["five equal"])).max(), rel=1e-2
    )
