"""The swinging cradle of the live explorer against `cradle.swing`."""

import numpy as np
import pytest
from script import Script, bits

from cradle import Chain, ImpulseCorrelation, Pendulums, swing

import explorer_engine  # isort: skip  (found by way of `script`)

# A swing in as many calls as there are frames.
WATCHED = """([given, seconds, frames]) => {
  const swing = cradle.swing(given);
  const impacts = swing.first ? [swing.first] : [];
  for (let k = 0; k < frames; k += 1) {
    const { status, impacts: more } = swing.advance(seconds / frames);
    if (status !== "swinging") throw new Error(status);
    impacts.push(...more);
  }
  return { impacts, positions: swing.positions(), velocities: swing.velocities(), time: swing.time,
    energy: swing.energy(), together: swing.together(), count: swing.impactCount };
}"""
SECONDS = 9.7  # thirty strokes of 0.1 m


@pytest.fixture(scope="module")
def script():
    script = Script(explorer_engine.engine())
    yield script
    script.context.close()


def case(masses, positions, restitution=1.0, ratio=0.0, **pendulums):
    given = {"masses": masses, "positions": positions, "restitution": restitution}
    return given | {"forward": ratio} | pendulums


CASES = {
    "the toy": case([1] * 5, [-0.02, 0, 0, 0, 0]),
    "two balls": case([1] * 5, [-0.02, -0.02, 0, 0, 0], 1, 0.15),
    "losses": case([1] * 5, [-0.02, 0, 0, 0, 0], 0.9, 0.15),
    "both sides": case([1] * 4, [-0.02, -0.01, 0, 0.03], 0.95, [0.3, 0.1]),
    "damping": case([1, 2, 1, 3], [-0.02, 0, 0, 0], 0.8, 0.1, damping=0.3),
    "gaps": case([1, 1, 1], [-0.02, 0, 0], 0.95, 0.3, gaps=0.001),
    "lengths": case([1, 2, 3], [-0.02, 0, 0], [0, 0.5], 0.1, length=[0.1, 0.12, 0.1]),
    "all differ": case([1, 1, 1], [-0.02, 0, 0.01], 0.6, 0.2, damping=[0.1, 0.2, 0.3],
                       gaps=[0.0005, 0.001], length=[0.1, 0.11, 0.12]),
    "stuck": case([1, 2], [-0.02, 0], 0.0, []),
    "pressed": case([1, 1, 1], [-0.02, 0, 0], 0.0, 0.2, gaps=0.002, length=[0.1, 0.2, 0.3]),
    "thrown": case([1, 1, 1], [0, 0, 0], 0.9, 0.2, velocities=[0.2, 0, -0.1]),
}  # fmt: skip


def in_python(given):
    n = len(given["masses"])
    hangs = {name: given[name] for name in ("length", "gaps", "damping") if name in given}
    return swing(
        Chain(given["masses"], given.get("velocities", [0] * n), given["restitution"]),
        ImpulseCorrelation(given["forward"], excess="saturate"),
        given["positions"],
        [SECONDS],
        pendulums=Pendulums(**hangs),
    )


@pytest.mark.parametrize("name", CASES)
def test_thirty_strokes(script, name):
    """Impacts, then the state at the end, and nothing of it depends on how often one looks.

    Not to the last bit: sines, exponentials and sums of products round differently.
    """
    run = in_python(CASES[name])
    assert len(run.impacts) >= 30 or name in ("stuck", "all differ", "lengths", "pressed")
    size = np.abs(run.positions).max()
    speed = max(np.abs(impact.before).max() for impact in run.impacts)
    for frames in (1, 577):
        found = script(WATCHED, [CASES[name], SECONDS, frames])
        assert found["count"] == len(found["impacts"]) == len(run.impacts)
        for one, other in zip(found["impacts"], run.impacts):
            assert tuple(one["contacts"]) == other.contacts
            assert one["time"] == pytest.approx(other.time, rel=1e-12, abs=1e-15)
            for field in ("positions", "before", "after"):
                limit = 1e-11 * (size if field == "positions" else speed)
                np.testing.assert_allclose(one[field], getattr(other, field), rtol=0, atol=limit)
            assert one["energyLoss"] == pytest.approx(other.energy_loss, rel=1e-10, abs=1e-20)
        np.testing.assert_allclose(found["positions"], run.positions[-1], rtol=0, atol=1e-11 * size)
        np.testing.assert_allclose(
            found["velocities"], run.velocities[-1], rtol=0, atol=1e-11 * speed
        )
        assert found["energy"] == pytest.approx(run.energy[-1], rel=1e-10)
        assert tuple(found["together"]) == run.together
        assert found["time"] == pytest.approx(SECONDS, rel=1e-12)


def test_each_impact_is_the_event_loops(script):
    """Velocities after an impact are those of the package for the velocities before, to the bit."""
    given = CASES["losses"]
    impacts = script(WATCHED, [given, 3.0, 50])["impacts"]
    assert len(impacts) > 8
    model = ImpulseCorrelation(0.15)
    for impact in impacts:
        assert impact["contacts"] == [0, 1, 2, 3]
        trace = model.solve(Chain([1] * 5, impact["before"], 0.9))
        assert bits(impact["after"]) == bits(trace.velocities)


def test_from_impact_to_impact(script):
    """Steps stop at the impacts that one long look finds; what comes next is known before."""
    stepped = script(
        """given => {
          const swing = cradle.swing(given);
          const seen = [];
          for (let k = 0; k < 20; k += 1) {
            const due = swing.nextEvent();
            const impact = swing.toNextImpact();
            seen.push([due, impact.time, swing.time, swing.velocities(), impact.after]);
          }
          return seen;
        }""",
        CASES["losses"],
    )
    run = in_python(CASES["losses"])
    for (due, time, now, velocities, after), impact in zip(stepped, run.impacts):
        assert due == time == now == pytest.approx(impact.time, rel=1e-12)
        np.testing.assert_allclose(velocities, after, rtol=0, atol=1e-16)
        np.testing.assert_allclose(after, impact.after, rtol=0, atol=1e-12)


def test_nothing_comes(script):
    """Equal pendulums that move as one never collide."""
    given = case([1, 1, 1], [-0.02] * 3)
    assert script("given => cradle.swing(given).toNextImpact(50)", given) is None
    assert script("given => cradle.swing(given).nextEvent(50)", given) is None


def test_begun_anew(script):
    """After a restart it is the swing of a new cradle."""
    given = CASES["gaps"]
    pairs = script(
        """given => {
          const swing = cradle.swing(given);
          swing.advance(3.3);
          swing.restart({ angles: [-0.3, -0.1, 0] });
          const other = cradle.swing({ ...given, positions: undefined, angles: [-0.3, -0.1, 0] });
          const all = one => [one.advance(2), one.positions(), one.velocities(), one.time];
          return [all(swing), all(other)];
        }""",
        given,
    )
    assert pairs[0] == pairs[1]
    assert len(pairs[0][0]["impacts"]) > 3


def test_dragged(script):
    """A ball that is dragged pushes those in its way, and no others; all are at rest."""
    dragged = script(
        """given => {
          const swing = cradle.swing(given);
          swing.advance(0.4);
          const places = swing.drag(1, -0.05, [0, 0, 0, 0]);
          return [places, swing.positions(), swing.velocities(), swing.time,
            swing.drag(2, 0.03), swing.advance(5).status];
        }""",
        case([1] * 4, [-0.02, 0, 0, 0], 0.9, 0.1, gaps=[0.001, 0, 0.002]),
    )
    places, positions, velocities, time, again, status = dragged
    assert places == positions == [-0.049, -0.05, 0, 0]
    assert velocities == [0] * 4
    assert time == 0
    assert again == pytest.approx([-0.049, -0.05, 0.03, 0.028], abs=1e-16)
    assert status == "swinging"


def test_more_than_a_call_may_take(script):
    """It says that it is behind, and goes on from there."""
    given = CASES["gaps"]
    slow = script(
        """given => {
          const swing = cradle.swing(given);
          const found = [];
          const states = [];
          while (swing.time < 9.7) {
            const { status, impacts } = swing.advance(9.7 - swing.time, 2);
            found.push(...impacts);
            states.push(status);
          }
          return [found, [...new Set(states)]];
        }""",
        given,
    )
    at_once = script(WATCHED, [given, SECONDS, 1])
    assert slow[0] == at_once["impacts"]
    assert slow[1] == ["behind", "swinging"]


def test_an_impact_that_is_not_solved_ends_the_swing(script):
    """Nothing moves any more, and every call says why."""
    answers = script(
        """given => {
          const swing = cradle.swing(given);
          const first = swing.advance(1);
          const state = [swing.time, swing.positions(), swing.velocities()];
          const second = swing.advance(1);
          return [first, second, state, [swing.time, swing.positions(), swing.velocities()]];
        }""",
        case([1] * 5, [-0.02, 0, 0, 0, 0], 0.9, 0.15, maxEvents=3),
    )
    assert answers[0] == answers[1] == {"status": "unfinished", "impacts": []}
    assert answers[2] == answers[3]
    assert answers[2][0] == pytest.approx(np.pi / 2 / np.sqrt(98.1))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"positions": [0.001, 0, 0]}, "positions: balls 0 and 1 overlap by 0.001 m"),
        ({"positions": [0, 0]}, "positions has 2 values; 3 balls need 3"),
        ({"velocities": [0, 0]}, "velocities has 2 values; 3 balls need 3"),
        ({"length": [0.1, 0, 0.1]}, "length[1] = 0.0; must be above 0"),
        ({"gaps": [0, 0, 0]}, "gaps has 3 values; must be 2, or one number"),
        ({"gaps": -1}, "gaps = -1.0; must be at least 0"),
        ({"gravity": 0}, "gravity = 0.0; must be above 0"),
        ({"restitution": 2}, "restitution = 2.0; must lie in [0, 1]"),
        (
            {"damping": [0, 0, 2.0], "length": 4.0, "gravity": 9.0},
            "damping[2] = 2.0; must be below the natural frequency sqrt(g/l) = 1.5",
        ),
    ],
)
def test_refusals(script, change, sentence):
    given = case([1] * 3, [-0.02, 0, 0]) | change
    assert script.each("cradle.swing", [given]) == [sentence]
