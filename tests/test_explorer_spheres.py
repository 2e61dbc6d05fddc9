"""The page's spheres against the package: the same loop of contact forces, translated."""

import numpy as np
import pytest
from chains import magnitudes, uniform
from explorer import EXPLORER
from script import Script

from cradle import Chain, SpringChain, collide, spring_velocities

import explorer_engine  # isort: skip  (found by way of `script`)


@pytest.fixture(scope="module")
def spheres():
    script = Script(explorer_engine.engine() + explorer_engine.spheres())
    yield script
    script.context.close()


def asked(script, masses, velocities, restitution=1.0, gap=0.0, record=False):
    """What the page answers, and the law of the contacts by which it does."""
    e = np.broadcast_to(restitution, len(masses) - 1).tolist()
    given = {"masses": masses, "velocities": velocities, "restitution": e, "gap": gap}
    return script("cradle.spheres", given | {"record": record}), script("cradle.spheresLaw", given)


def test_the_package_agrees_to_five_digits(spheres):
    rng = np.random.default_rng(33)
    for n in (2, 3, 4, 5, 7) * 8:
        masses = magnitudes(rng, 1, n).tolist()
        velocities = np.sort(uniform(rng, -2, 2, n))[::-1].tolist()
        restitution, gap = rng.choice([1, 0.9, 0.8], n - 1), float(rng.choice([0, 1e-6, 1e-5]))
        answer, law = asked(spheres, masses, velocities, restitution, gap)
        assert answer["status"] == "finished"
        expected = spring_velocities(masses, velocities, **law, gaps=gap, accuracy=1e-7)
        fastest = max(-np.diff(velocities))
        np.testing.assert_allclose(answer["velocities"], expected, rtol=0, atol=1e-5 * fastest)


@pytest.mark.parametrize("e", [0.97, 0.66, 0.5, 0.02])
@pytest.mark.parametrize("masses", [[1.0, 1.0], [0.05, 2.0]])
def test_the_restitution_is_that_of_two_balls_at_one_metre_a_second(spheres, e, masses):
    """And the stiffness Hertz's, of steel."""
    for speed in (1.0, 0.5):
        answer, law = asked(spheres, masses, [speed, 0.0], e)
        found = (answer["velocities"][1] - answer["velocities"][0]) / speed
        assert found == pytest.approx(e, abs=1e-5) if speed == 1 else found > e
    radii = [(3 * m / (4 * np.pi * 7800)) ** (1 / 3) for m in masses]
    modulus = 210e9 / (2 * (1 - 0.3**2))
    k = 4 / 3 * modulus * (radii[0] * radii[1] / sum(radii)) ** 0.5
    assert law["stiffness"] == pytest.approx([k])


@pytest.mark.parametrize(("e", "gap"), [(1.0, 0.0), (0.95, 2e-6)])
def test_the_history_is_that_of_the_trace(spheres, e, gap):
    """Events in their order, impulses, and a path of small steps from the start to the outcome."""
    answer, law = asked(spheres, [1.0] * 5, [1.0, 0, 0, 0, 0], e, gap, record=True)
    model = SpringChain(**law, gaps=gap, accuracy=1e-8)
    trace = collide(Chain([1] * 5, [1, 0, 0, 0, 0]), model)
    assert [(one["kind"], one["contact"]) for one in answer["events"]] == list(trace.events)
    assert answer["collisions"] == trace.collisions.tolist()
    np.testing.assert_allclose(answer["pathImpulses"][-1], trace.impulses, rtol=2e-5)
    path = np.array(answer["path"])
    assert path[0].tolist() == [1, 0, 0, 0, 0]
    assert path[-1].tolist() == answer["velocities"]
    # At its row an event is as the trace has it, up to a step.
    for event, row in zip(answer["events"], trace.path[1:]):
        assert abs(path[event["row"]] - row).max() < 0.1
    assert abs(np.diff(path, axis=0)).max() < 0.1


def test_what_losses_have_opened_closes_again(spheres):
    """Also where balls touch at the start: an impact begins with no "close", this one has some."""
    masses, v = [0.307, 0.303, 0.394, 0.321], [1.0, 0, 0, 0]
    answer, law = asked(spheres, masses, v, 0.9, record=True)
    trace = collide(Chain(masses, v), SpringChain(**law, accuracy=1e-5))
    closed = sorted(event.contact for event in trace.events if event.kind == "close")
    told = [event["contact"] for event in answer["events"] if event["kind"] == "close"]
    assert sorted(told) == closed
    assert 0 in closed
    assert answer["collisions"] == trace.collisions.tolist()


def test_linear_springs(spheres, still):
    """The engine's, and those of the live cradle of chapter 2."""
    tab = still(chapter="compliance")
    tab.push("Next hit")
    for stiffness in (0.02, 1.0, 7.0):
        law = {"stiffness": [1.0, stiffness], "exponent": 1.0}
        given = {"masses": [1, 1, 1], "velocities": [1, 0, 0], "viscosity": [0, 0]} | law
        expected = collide(Chain([1] * 3, [1, 0, 0]), SpringChain(**law)).velocities
        answer = spheres("cradle.forces", given)["velocities"]
        np.testing.assert_allclose(answer, expected, rtol=0, atol=1e-5)
        tab.typed("stiffness quotient", str(stiffness))
        assert tab.drawn()["after"] == answer


def test_what_has_no_answer_says_so(spheres):
    assert asked(spheres, [1.0, 1.0], [1.0, 0.0], 0.01)[0] == {"status": "lossy"}
    light = asked(spheres, [1.0, 1e-9, 1.0], [1.0, 0.0, 0.0])[0]
    assert light == {"status": "unfinished"}
    apart = asked(spheres, [1.0, 1.0], [0.0, 1.0], record=True)[0]
    assert apart["velocities"] == [0, 1]


def test_a_reader_chooses_spheres(still):
    """By hand and by an address; the ratio goes, the gaps come; the map and the words follow."""
    tab = still("#speeds=1,0,0&restitution=0.9")
    assert tab.get_by_label("gaps", exact=True).is_hidden()
    touching = tab.choose("spheres")["after"]
    assert tab.get_by_label("ratio", exact=True).is_hidden()
    tab.typed("gaps", "3,5")
    apart = tab.drawn()["after"]
    assert apart[2] != touching[2]
    setting = tab.state("setting")
    assert (setting["law"], setting["gap"]) == ("spheres", 3.5)
    tab.choose("Each ratio")
    assert "There is no ratio here" in tab.inner_text(".pictures")
    again = still("#" + tab.state("fragment()"))
    assert again.drawn()["after"] == apart
    refused = still("#speeds=1,0&law=glue")
    refused.drawn()
    assert "law = glue; must be rule or spheres or springs" in refused.inner_text(".words")
    lossy = still("#speeds=1,0,0&law=spheres&restitution=0.01")
    lossy.drawn()
    assert "choose a restitution of 0.02" in lossy.inner_text(".words")
    assert lossy.state("setting")["restitution"] == [0.01, 0.01]
    lossy.go_to("speeds=1,0,0&masses=0.014,98,58.9&restitution=0.87,0.28&law=spheres")
    far = lossy.drawn()
    assert lossy.locator(".balance").is_hidden()  # names of nothing
    assert "larger restitutions, or masses nearer" in lossy.inner_text(".words")
    for remedy in ({"restitution": [0.87, 0.5]}, {"masses": [0.05, 30, 20]}):  # both help
        lossy.evaluate(
            f"(setting) => {EXPLORER}.state.set(setting)", far | remedy | {"law": "spheres"}
        )
        assert lossy.drawn()["after"]
