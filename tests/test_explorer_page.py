"""The live explorer as a reader meets it: the built page, opened from its file in a browser."""

import re
from dataclasses import replace

import numpy as np
import pytest
from explorer import SETTING, chain_of, disc, same_outcome, settings
from pages import colour, contrast, show

from cradle import (
    Chain,
    ImpactNotFinished,
    ImpulseCorrelation,
    Pendulums,
    collide,
    paper_chain,
    swing,
)
from cradle.tables import paper_sequences


def swung(setting, strokes: int):
    """The same cradle by `cradle.swing`."""
    chain, model = chain_of(setting)
    hanging = Pendulums(length=1.0)
    frequency = hanging.natural_frequency(len(chain))
    released = Chain(chain.masses, np.zeros(len(chain)), chain.restitution)
    times = np.append(0.2, 0.7 + np.arange(strokes)) * np.pi / frequency[0]  # hits: 0.5, 1.5, ...
    return swing(released, model, -chain.velocities / frequency, times, pendulums=hanging)


def test_swing_of_the_page(linked):
    """Velocities after hits and positions between them are those of `cradle.swing`.

    Rounding differs, grows from hit to hit and may decide a tie: few hits, all balls in motion.
    """
    tab = linked()
    for setting in settings(24):
        run = swung(setting, 3)
        hits, places = tab.evaluate(
            """([setting, times]) => {
              const swing = new cradleExplorer.Swing(setting);
              const happened = [0, 1, 2].map((k) => swing.hit(k)).filter((hit) => hit.happened);
              return [happened.map((hit) => hit.after), times.map((t) => swing.positions(t))];
            }""",
            [setting, run.times.tolist()],
        )
        after = [impact.after.tolist() for impact in run.impacts]
        assert len(hits) == len(after)
        np.testing.assert_allclose(hits, after, rtol=0, atol=1e-8)
        np.testing.assert_allclose(places, run.positions, rtol=0, atol=1e-8)
    # With losses balls end up together, and the last hit comes at the same number as in Python.
    setting = {
        "masses": [1.0, 2.0], "speeds": [1.0, 0.0], "restitution": [0.5], "forward": [],
        "backward": [], "letters": "--",
    }  # fmt: skip
    number, after = tab.evaluate(
        """(setting) => {
          const swing = new cradleExplorer.Swing(setting);
          let k = 0;
          while (swing.hit(k).happened) k += 1;
          return [k, swing.hit(k).after];
        }""",
        setting,
    )
    assert number == len(swung(setting, 100).impacts) > 10
    assert np.abs(after) == pytest.approx([1 / 3, 1 / 3])
    assert after[0] == pytest.approx(after[1])


def test_copied_python_gives_the_same_numbers(still):
    """The text of the button, run as a program."""
    tab = still(stopped=True)
    tab.evaluate(
        "navigator.clipboard.writeText = (text) => ((window.copied = text), Promise.resolve())"
    )
    for fragment in (
        "speeds=1,0.5,0,-0.35&forward=0.3,0.12&backward=0.2&masses=1,0.05,3,0.166",
        "scene=ABCCAB", "scene=half", "speeds=1,0,0&restitution=0.9&law=spheres&gap=2",
    ):  # fmt: skip
        tab.go_to(fragment)
        asked = tab.later(50)
        tab.push("Copy Python", 3900)
        assert tab.inner_text(".told") == "Python copied"
        tab.clock.run_for(200)
        assert tab.inner_text(".told") == ""
        program = {}
        exec(tab.evaluate("window.copied"), program)
        after = program["trace"].velocities
        if "spheres" in fragment:  # to five digits
            np.testing.assert_allclose(after, asked["after"], rtol=0, atol=2e-5)
            first = program["run"].impacts[0].after  # strings pull while contacts push
            np.testing.assert_allclose(first, asked["after"], rtol=0, atol=1e-4)
            second = program["run"].impacts[1].after - tab.state("swing.hit(1).after")
            assert abs(second).max() > 0.01  # as the page says
            continue
        assert after.tolist() == asked["after"]
        np.testing.assert_allclose(program["run"].impacts[0].after, asked["after"], atol=1e-9)
    tab.get_by_text("The same in Python").click()  # line by line in the page, too
    lines = [line for line in tab.evaluate("window.copied").splitlines() if line]
    assert [line for line in tab.inner_text("details pre").splitlines() if line] == lines


def test_paper_chains_by_their_letters(linked):
    """Letter by letter as a reader does it, and as a scene: Tables 1 and 2 of the paper."""
    tab = linked()
    for sequence in paper_sequences():
        by_hand, scene = tab.evaluate(
            """(sequence) => {
              const { data, lettered, resized } = cradleExplorer;
              let setting = resized(data.scenes[0].setting, sequence.length);
              [...sequence].forEach((letter, k) => (setting = lettered(setting, [k], letter)));
              return [setting, data.scenes.find((one) => one.key === sequence).setting];
            }""",
            sequence,
        )
        expected = paper_chain(sequence, excess="saturate")
        assert chain_of(by_hand) == chain_of(scene) == expected


def test_a_ball_is_dragged_and_let_go(visit):
    tab = visit("#scene=one", stopped=True)
    tab.push("Let go", 1000)
    tab.push("Pause")
    tab.push("Pull back")
    tab.act(f"set(cradleExplorer.atRest({SETTING}))")
    tab.clock.run_for(50)
    x, y = tab.grab(disc(4))
    for step in range(1, 9):
        tab.mouse.move(x + 10 * step, y)
        tab.clock.run_for(16)
    at, _ = tab.middle(disc(4))
    assert abs(at - (x + 80)) < 8
    tab.clock.run_for(1000)  # it waits in the hand
    assert tab.middle(disc(4))[0] == at
    tab.mouse.up()
    assert same_outcome(tab.later(50))
    assert tab.inner_text("button.main") == "Pause"
    tab.clock.run_for(950)  # the hit comes after half a second
    assert tab.state("clock.time") == pytest.approx(1, abs=0.05)
    first, second = (tab.middle(disc(ball))[0] for ball in (0, 1))
    assert second - first > 60  # the hit has sent ball 1 to the left; at rest they touch


def test_pull_back_where_it_has_an_effect(visit):
    """Balls that are held already cannot be pulled back; once let go they can."""
    tab = visit(stopped=True)
    tab.clock.run_for(100)
    for button, wait, enabled in (
        ("Let go", 1000, True), ("Pause", 50, True), ("Pull back", 1000, False)
    ):  # fmt: skip
        tab.push(button, wait)
        assert tab.get_by_role("button", name="Pull back").is_enabled() is enabled
    assert tab.state("clock.time") == 0


def test_only_a_drag_moves_a_ball(visit):
    """A tap on a ball leaves the swing as it is, and a ball taken at its edge does not jump."""
    tab = visit("#scene=one", stopped=True)
    ball = disc(4)
    tab.push("Let go", 1000)
    before = tab.state("clock.time")
    pulled(tab, ball, 1)
    tab.mouse.up()
    tab.clock.run_for(500)
    assert tab.state("clock.time") == pytest.approx(before + 0.5, abs=0.07)
    assert tab.state("setting")["speeds"] == [1, 0, 0, 0, 0]
    tab.push("Pause")
    tab.push("Pull back", 50)
    x = pulled(tab, ball, 40, from_edge=15)
    assert abs(tab.middle(ball)[0] - (x + 40)) < 8


def pulled(tab, ball: str, way: int, from_edge: int = 0) -> float:
    """Take a ball, move it, and return where its middle was."""
    x, y = tab.grab(ball, from_edge)
    tab.mouse.move(x + from_edge + way, y)
    tab.clock.run_for(50)
    return x


def test_balls_in_the_way_come_along(still):
    tab = still("#scene=one")
    x, y = tab.grab(disc(2))
    tab.mouse.move(x - 60, y, steps=6)
    taken = tab.drawn()["speeds"]
    assert taken[0] == 1  # was pulled back further
    assert taken[1] == taken[2] > 0
    assert taken[3:] == [0, 0]
    tab.mouse.move(x, y)  # and let go of on the way back
    assert tab.drawn()["speeds"] == [1, 0, 0, 0, 0]
    tab.mouse.up()
    assert tab.inner_text("button.main") == "Let go"  # less motion: not by itself


def test_sliders_change_the_outcome(still):
    tab = still("#scene=small")
    for label, row in (
        ("mass", "masses"),
        ("restitution, balls 2 and 3", "restitution"),
        ("ratio, pushed from the left", "forward"),
    ):
        tab.act("take('small')")
        before = tab.drawn()
        tab.click("label[title='ball 2']")
        tab.drawn()  # its sliders are there
        for _ in range(3):
            tab.get_by_label(label, exact=True).press("ArrowLeft")
        after = tab.drawn()
        assert sum(a != b for a, b in zip(before[row], after[row], strict=True)) == 1
        assert after["after"] != before["after"]
        assert same_outcome(after)
        # What is shown is what was computed: the bars, the words, the code.
        assert tab.bars(".outcome") == pytest.approx(after["after"], abs=0.0051)
        assert tab.inner_text(".words").startswith(
            "Before the first hit, ball 1 moves right at 1.00 m/s"
        )


def test_momentum_and_energy_add_up(linked):
    """Arrows from zero to the momentum before; shares of the energy named, and their sum."""
    tab = linked("speeds=1,0,0,0,0&masses=1,2,1,1,3&forward=0.2&restitution=0.8")
    setting = tab.drawn()
    masses, before, after = (np.array(setting[name]) for name in ("masses", "speeds", "after"))
    momentum, energy = tab.locator(".balance .plot").all()
    arrows = re.findall(r"M([\d.]+) [\d.]+H[\d.]+L([\d.]+) .*?--ball-(\d)", momentum.inner_html())
    order = [*np.flatnonzero(after > 0), *np.flatnonzero(after < 0)]
    assert [int(ball) for *_, ball in arrows] == order
    ends = np.cumsum([0, *(masses * after)[order]])
    zero, told = (float(x) for x in re.findall(r'd="M([\d.]+) 0V', momentum.inner_html()))
    unit = (told - zero) / (masses @ before)
    drawn = [[float(x) for x in places] for *places, _ in arrows]
    np.testing.assert_allclose(drawn, zero + unit * np.stack([ends[:-1], ends[1:]], 1), atol=0.02)
    shares = masses * after**2 / (masses @ before**2)
    named = "".join(
        f" ball {ball}: {100 * share:.0f}\u00a0%," for ball, share in enumerate(shares, 1)
    )
    in_all = f"{100 * shares.sum():.0f}\u00a0%"
    label = energy.locator("svg").get_attribute("aria-label")
    assert label == f"Kinetic energy:{named[:-1]}; in all {in_all} of that before the hit"
    assert tab.inner_text(".balance small") == f"total {in_all}"
    largest = shares.argmax()
    assert f"ball {largest + 1}: {100 * shares[largest]:.0f}\u00a0%" in energy.inner_text()
    # A momentum in the middle of two last digits is rounded alike before the hit and after it.
    linked("speeds=1,0,0&masses=10.795,0.2749,3.6818&forward=0.5").drawn()
    said = momentum.locator("svg").get_attribute("aria-label")
    assert len(set(re.findall(r"[\d.]+", said))) == 1, said


def test_energy_in_the_contacts(linked):
    """Within a hit, event by event: what Python says that the contacts can still give back."""
    tab = linked()
    told = """(setting) => {
      const record = new cradleExplorer.Swing(setting).record(0);
      const along = cradleExplorer.progress(record ?? { pathImpulses: [] });
      const end = along.at(-1);
      return along.map((at) => cradleExplorer.stored(setting, record, at / end));
    }"""
    checked = 0
    for setting in settings(24):
        chain, model = chain_of(setting)
        path = collide(chain, model).path
        energies = 0.5 * np.square(path) @ chain.masses
        held = tab.evaluate(told, setting)
        for limit in range(1, 40):
            try:
                collide(chain, replace(model, max_events=limit))
                break
            except ImpactNotFinished as stopped:
                trace, stored = stopped.trace, stopped.stored
            row = len(trace.events)
            # Of two runs side by side one may be ahead of its last row.
            if not np.allclose(path[row], trace.velocities, rtol=0, atol=1e-12):
                continue
            unit = chain.masses.max() * np.abs(chain.velocities).max() ** 2
            assert held[row] / unit == pytest.approx(stored, abs=1e-9)
            whole = energies[row] + held[row] + trace.energy_loss
            assert whole == pytest.approx(energies[0], rel=1e-9)
            checked += 1
    assert checked > 200
    # By contact forces: without losses, all that does not move; with them, less and less of it.
    for law in ("springs&stiffness=2", "spheres&gap=1", "spheres&gap=1&restitution=0.9"):
        tab.go_to("speeds=1,0,0,0&law=" + law)
        setting = tab.drawn()
        path, held = tab.state("swing.record(0).path"), tab.state("swing.record(0).stored")
        masses = np.array(setting["masses"])
        lost = 0.5 - 0.5 * np.square(path) @ masses - held
        last = 0.5 - 0.5 * np.square(setting["after"]) @ masses
        assert max(held) > 0.2
        assert np.diff(lost).min() > -1e-3
        assert -1e-3 < lost.min() <= lost.max() < last + 1e-3


def test_the_bar_of_energy_is_whole_within_a_hit(linked):
    """What moves and what the contacts hold; afterwards nothing is in the contacts."""
    for restitution, lost in ((1, False), (0.5, True)):
        tab = linked(f"speeds=1,0,0&forward=0.15&restitution={restitution}")
        tab.drawn()
        tab.act("view.part = 0.35")
        tab.drawn()
        bar = tab.locator(".balance .plot").last
        moving = float(tab.inner_text(".balance small").split()[1])
        label = bar.locator("svg").get_attribute("aria-label")
        held = float(re.search(r"in the contacts (\d+)", label)[1])
        assert ("in the contacts: 57" in bar.inner_text()) is not lost
        assert (moving + held < 99) if lost else abs(moving + held - 100) <= 1
        drawn = bar.locator(".stored").get_attribute("d")
        start, wide = (float(x) for x in re.findall(r"M([\d.]+).*h([\d.]+)", drawn)[0])
        assert start / wide == pytest.approx(moving / held, rel=0.05)
        tab.act("view.part = 1")
        tab.drawn()
        assert bar.locator(".stored").count() == 0
        assert tab.inner_text(".balance small").startswith("total")


def test_a_ratio_above_its_bound_says_so(linked):
    """One ball strikes others at rest: what comes out is that of the bound."""
    for fragment, said in (
        ("speeds=1,0,0&forward=0.7", " (bound 0.5)"),
        ("speeds=1,0,0&forward=0.5", ""),
        ("speeds=1,0,0,0,0&forward=0.7", " (bound 0.5 to 0.667)"),
        ("speeds=1,0,0,0&masses=1,2,0.5,1&forward=0.6&backward=0.1", None),
        ("scene=ABCCAB", None),
    ):
        tab = linked(fragment)
        setting = tab.drawn()
        held = tab.evaluate(f"cradleExplorer.boundedRatios({SETTING})")
        same = collide(chain_of(setting)[0], ImpulseCorrelation(held["forward"], held["backward"]))
        np.testing.assert_allclose(same.velocities, setting["after"], rtol=0, atol=1e-9)
        if said is not None:
            labels = tab.locator(".slider:visible label").all_text_contents()
            assert labels[-1] == f"ratio{said}"


OUTSIDE = "mass must lie between 0.01 and 100 kg. In force: 1 kg."
NO_NUMBER = "{} needs a number, such as 0.5. In force: {}."
NO_RATIO = "ratio must lie between 0 and 1. In force: 0.15."
REFUSED = [
    ("mass", "1000", OUTSIDE),
    ("mass", "", NO_NUMBER.format("mass", "1 kg")),
    ("restitution", "1.5", "restitution must lie between 0 and 1. In force: 1."),
    ("ratio", "2", NO_RATIO),
    ("ratio", "-1", NO_RATIO),
    ("ratio", "0;1", NO_NUMBER.format("ratio", 0.15)),
    ("mass", "1.000,5", NO_NUMBER.format("mass", "1 kg")),
    ("mass", "heavy", NO_NUMBER.format("mass", "1 kg")),
    ("mass", "1,000", "mass could be 1 or 1000: please write one of these. In force: 1 kg."),
    ("ratio", "0.1234567", "ratio can have six digits after the point. In force: 0.15."),
]


def test_typed_values_out_of_range_are_refused(still):
    """They stay, marked, with a sentence that says what is in force, and change nothing."""
    tab = still("#scene=small")
    before = tab.drawn()
    for number, (label, text, sentence) in enumerate(REFUSED):
        key = ("Enter", "Tab")[number % 2]
        box = tab.typed(label, text, key)
        alert = box.locator("xpath=ancestor::div[starts-with(@class, 'slider')]").get_by_role(
            "alert"
        )
        assert tab.drawn() == before
        assert alert.inner_text() == sentence
        assert box.get_attribute("aria-describedby") == alert.get_attribute("id")
        tab.push("Next hit")  # a redraw wipes nothing away
        tab.push("Pull back")
        tab.drawn()
        assert box.input_value() == text
        assert box.get_attribute("aria-invalid") == "true"
        for mode in ("light", "dark") if number < 2 else ():
            show(tab, 1400, mode)
            assert contrast(colour(box, "borderTopColor"), colour(box, "backgroundColor")) > 3
        # What is right, if only the value in force, ends it.
        tab.typed(label, sentence.split("In force: ")[1].split()[0].rstrip("."), key)
        assert tab.drawn() == before
        assert box.get_attribute("aria-invalid") == "false"
        assert alert.inner_text() == ""
    # So does another setting: the box then shows what is in force.
    box = tab.typed("ratio", "2", "Tab")
    tab.push("next scene")
    assert tab.drawn()["forward"] == [0.5] * 3
    assert box.input_value() == "0.5"
    assert box.get_attribute("aria-invalid") == "false"


def test_numbers_are_read_as_people_type_them(still):
    """A comma is a point, whatever the browser's language: 0,25 is not 25."""
    tab = still("#scene=small")
    for text, number in (
        ("0,25", 0.25), (".5", 0.5), ("1e-1", 0.1), (" 0.3 ", 0.3), ("+0,2", 0.2), ("0,125", 0.125),
    ):  # fmt: skip
        box = tab.typed("ratio", text, "Tab")
        assert set(tab.drawn()["forward"]) == {number}
        assert box.input_value() == str(number)
        assert box.get_attribute("aria-invalid") == "false"


def test_number_material_and_sweep(still):
    tab = still("#scene=small")
    tab.unfold()
    for group, name in (("number of balls", "3"), ("material", "D")):
        row = tab.get_by_role("radiogroup", name=group, exact=True)
        row.locator("label", has_text=name).click()
    setting = tab.drawn()
    assert setting["letters"] == "DDD"
    assert setting["masses"] == [0.166] * 3
    assert same_outcome(setting)
    tab.click("label:has-text('Each ratio')")
    tab.drawn()
    assert tab.locator(".drags-x polyline").count() == 3
    tab.drag(".drags-x svg", 30)
    moved = tab.drawn()
    assert moved["forward"] == moved["backward"] != setting["forward"]
    assert same_outcome(moved)


def test_keys_that_come_within_one_frame_count_each(still):
    """A browser may pass on several before it draws; no step is lost."""
    twice = """(node) => {
      for (let k = 0; k < 2; k += 1)
        node.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    }"""
    tab = still("#scene=small")
    tab.locator(".ball[data-ball='4']").evaluate(twice)
    assert tab.drawn()["speeds"] == [1, 0, 0, 0, -0.2]
    tab.go_to("scene=map")
    before = tab.drawn()["masses"]
    assert before == [1, 1, 1]
    tab.locator(".point").evaluate(twice)
    assert tab.drawn()["masses"] == [1, 1, pytest.approx(1 / 1.2, rel=1e-3)]


def test_a_browser_that_does_not_allow_copying(still):
    """A page that came over plain HTTP has no clipboard."""
    tab = still()
    tab.evaluate("Object.defineProperty(navigator, 'clipboard', { value: undefined })")
    for name in ("Copy Python", "Copy link"):
        tab.push(name)
        tab.wait_for_function("document.querySelector('.told').textContent")
        assert tab.inner_text(".told").startswith("The browser does not allow copying")
        tab.evaluate("document.querySelector('.told').textContent = ''")
