"""Guesses, questions and tasks on the live cradles: what is covered, and what the solver says."""

import itertools
import re

import numpy as np
import pytest
from explorer import EXPLORER, chain_of, disc

from cradle import Chain, ImpulseCorrelation, SpringChain, collide


def test_the_first_page_is_guessed(still):
    """Nothing tells the outcome before the balls have moved; then the guess stays as an outline."""
    tab = still(chapter="intro")
    expected = collide(*chain_of(tab.drawn())).velocities
    host = tab.locator(".cradle-explorer")
    for value in expected[np.abs(expected) > 0.05]:
        assert f"{abs(value):.2f}" not in host.inner_text()
    answer = tab.locator(".admonition", has_text="Answer: two balls pulled back")
    assert tab.locator(".question p").last.is_hidden()
    assert answer.is_hidden()
    for ball, key, times in ((5, "ArrowRight", 18), (1, "ArrowLeft", 2)):
        for _ in range(times):
            tab.get_by_label(f"your guess for ball {ball}, m/s").press(key)
    tab.drawn()
    guess = [-0.1, 0, 0, 0, 0.9]
    assert tab.state("view.guess.values") == pytest.approx(guess)
    assert "80\u00a0% of the momentum and 82\u00a0% of the energy" in host.inner_text()
    assert "Fill both, to 100\u00a0%." in host.inner_text()
    for ball, value in ((0, 0), (4, 1), (0, -0.1), (4, 0.9)):
        tab.act(f"guess({ball}, {value})")
        tab.drawn()
        assert ("Both are kept." in host.inner_text()) == (value == 1)
    tab.push("Next hit")
    tab.drawn()
    assert tab.bars() == expected.round(2).tolist()
    assert tab.locator(".outcome .drawn .guess").count() == 5
    off = np.abs(expected - guess)
    words = f"off by at most {off.max():.2f} m/s, at ball {off.argmax() + 1}"
    assert words in host.inner_text()
    assert tab.locator(".question p").last.is_visible()
    assert answer.is_visible()
    # One may guess again, from the last guess; a ball that is pulled now spends none.
    tab.push("Guess again")
    tab.drawn()
    assert tab.state("view.guess.values") == pytest.approx(guess)
    tab.evaluate("matchMedia = () => ({ matches: false })")  # from here on a reader of all motion
    tab.drag(disc(0), 5)
    tab.drawn()
    tab.get_by_label("your guess for ball 5, m/s").press("ArrowLeft")
    assert tab.drawn()["speeds"][0] < 1
    assert tab.get_by_role("button", name="Let go").is_visible()
    tab.push("Next hit")
    # From here on nothing is covered until one asks for it.
    tab.get_by_label("ratio", exact=True).press("ArrowLeft")
    after = tab.drawn()["after"]
    assert tab.bars() == np.round(after, 2).tolist()
    assert tab.get_by_role("button", name="Guess again").is_enabled()


def test_the_next_step_is_for_one_striker(still):
    tab = still("")
    for speed in (0, -1):
        tab.evaluate(f"{EXPLORER}.state.pull([[1, {speed}]])")
        tab.act("step()")
        tab.drawn()
        assert tab.locator(".next:visible").count() == (speed == 0)


def test_the_next_step_is_of_its_setting_alone(still):
    """With the ratio 0, say, the answer is that of the school books."""
    tab = still("")
    for times, seen in ((0, 1), (1, 0)):
        for _ in range(times):
            tab.get_by_label("ratio", exact=True).press("ArrowLeft")
        tab.act("step()")
        tab.drawn()
        assert tab.locator(".next:visible").count() == seen


def test_the_next_step_is_of_the_first_hit_alone(still):
    tab = still("")
    for number in (0, 1):
        tab.act("step()")
        tab.drawn()
        assert tab.state("view.number") == number
        assert tab.locator(".next:visible").count() == (number == 0)


def test_no_outline_runs_through_a_number(still):
    tab = still("")
    tab.drawn()
    for ball, speed in enumerate((-0.1, 0.15, 1.1), start=1):
        tab.get_by_label(f"your guess for ball {ball}, m/s").fill(str(speed))
    tab.act("step()")
    tab.drawn()
    crossed = tab.evaluate("""() => [...document.querySelectorAll(".drawn .number")].map((it) => {
      const box = it.getBoundingClientRect();
      const outlines = document.querySelectorAll(".drawn rect.guess, .drawn rect.before");
      return [...outlines].some((rect) => {
        const { left, right, top, bottom, width } = rect.getBoundingClientRect();
        const inside = (x) => width > 0 && box.left < x && x < box.right;
        return top < box.bottom && box.top < bottom && (inside(left) || inside(right));
      });
    })""")
    assert crossed == [False] * 3


@pytest.mark.parametrize(
    ("name", "before"), [("Guess first", 1), ("Full screen", 0), ("Full screen", 1)]
)
def test_scene_by_scene_is_guessed(still, name, before):
    """Once the button is pressed, or in full screen, until it is released."""
    tab = still("", width=1366, height=768)
    button = tab.get_by_role("button", name="Guess first", include_hidden=True)
    pressed = button.get_attribute
    tab.drawn()
    assert (tab.state("covered"), pressed("aria-pressed")) == (True, "false")
    assert not button.is_visible()  # before the first hit there is little more than the cradle
    assert not tab.locator(".slider:visible, .next:visible").count()
    for _ in range(before):
        tab.act("step()")
        tab.drawn()
        assert button.is_visible()
        assert "Why not here? Balls 2 and 3 touch." in tab.inner_text(".next")
        assert tab.get_by_label("ratio", exact=True).is_visible()
    tab.push(name)
    tab.wait_for_function("document.querySelector('.run [aria-pressed=true]')")
    for _ in range(3):
        tab.keyboard.press("PageDown" if name == "Full screen" else "ArrowRight")
        tab.drawn()
        assert (tab.state("covered"), pressed("aria-pressed")) == (True, "true")
        tab.push("Next hit")
        tab.drawn()
        assert not tab.state("covered")
    tab.act("take('losses')")
    tab.drawn()
    assert tab.inner_text(".guessed").endswith("of energy some is lost.")
    tab.push("Guess first")
    tab.keyboard.press("ArrowRight")
    tab.drawn()
    assert (tab.state("covered"), pressed("aria-pressed")) == (False, "false")


@pytest.mark.parametrize("name", ["intro", "compliance", "explorer"])
def test_the_guess_comes_before_the_button(still, name):
    """On a phone; on a desk it stands beside them."""
    tab = still(chapter=name, width=390)
    if name == "explorer":
        tab.push("Guess first")
    tab.drawn()
    assert not tab.locator(".scene-text:visible").count()
    last = tab.locator(".handles input").last.bounding_box()
    button = tab.get_by_role("button", name="Let go").bounding_box()
    assert last["y"] + last["height"] < button["y"] < last["y"] + 300


@pytest.mark.parametrize("width", [390, 1400])
def test_the_cradle_stays_where_it_is_when_the_answer_comes(still, width):
    """What is said of the scene, up to three lines above it, has its place before."""
    tab = still("#scene=small", width=width)
    tab.push("Guess first")
    tab.drawn()
    said, top = (
        "document.querySelector('.said-of-scene').checkVisibility({ checkVisibilityCSS: true })",
        "document.querySelector('.cradle').getBoundingClientRect().top + scrollY",
    )
    assert not tab.evaluate(said)
    before = tab.evaluate(top)
    tab.push("Next hit")
    tab.drawn()
    assert tab.evaluate(said)
    assert tab.evaluate(top) == before


@pytest.mark.parametrize("width", [1100, 1400])
def test_nothing_moves_on_a_desk_when_the_first_hit_opens_the_rest(still, width):
    """What to do first is told once, where the words on the scene will come."""
    tab = still("", width=width)
    tab.drawn()
    told = tab.locator(".first:visible, .first-guess:visible")
    top = "document.querySelector('.cradle').getBoundingClientRect().top"
    before = tab.evaluate(top)
    (words,) = told.all_inner_texts()
    assert words.startswith("First guess")
    tab.act("step()")
    tab.drawn()
    assert not told.count()
    assert (tab.evaluate(top), tab.evaluate("scrollY")) == (before, 0)


def test_what_to_do_first_gives_way_on_a_phone(still):
    """What to do next takes its room: the button stays under the finger."""
    tab = still("", width=390)
    tab.drawn()
    told = tab.locator(".what-to-do > span:visible")
    room = "document.querySelector('.what-to-do').getBoundingClientRect().height"
    top = "document.querySelector('.run .main').getBoundingClientRect().top"
    before = tab.evaluate(room), tab.evaluate(top)
    (words,) = told.all_inner_texts()
    assert words.startswith("First guess")
    tab.act("step()")
    tab.drawn()
    (words,) = told.all_inner_texts()
    assert words.startswith("Choose another scene")
    assert (tab.evaluate(room), tab.evaluate(top)) == pytest.approx(before, abs=1)


def test_pictures_wait_after_a_hit_that_was_guessed(still):
    """So that the guess can be compared; the balls rest a little, then they swing on."""
    tab = still(chapter="intro", stopped=True)
    tab.later(50)
    tab.get_by_label("your guess for ball 5, m/s").press("ArrowRight")
    tab.push("Let go", 1000)
    at = tab.state("clock.time")
    tab.later(500)
    assert tab.state("clock.time") == at == tab.evaluate("cradleExplorer.Swing.time(0)")
    for _ in range(4):
        tab.later(1000)
    assert tab.state("clock.time") > tab.evaluate("cradleExplorer.Swing.time(1)")
    assert (tab.state("clock.playing"), tab.state("view.number")) == (True, 0)
    assert tab.locator(".outcome .drawn .guess").count() == 5
    # On a page of its own who presses a button has compared.
    tab = still("", stopped=True)
    tab.later(50)
    tab.push("Let go", 2500)
    assert tab.state("view.number") == 0
    tab.push("Pause", 50)
    tab.push("Go on")
    for _ in range(3):
        tab.later(1000)
    assert tab.state("view.number") > 1


@pytest.mark.parametrize("answered", [True, False])
@pytest.mark.parametrize(
    ("name", "setting", "said", "words"),
    [
        ("multiple_impacts", "", "3", "You said 3; it is 4."),
        ("patterns", "", "none", "You said none; it is balls 1 and 2."),
        ("patterns", "speeds=1,0,0&restitution=0.5", "none", "Yes: none."),
        ("patterns", "speeds=1,0,0&forward=0.5", "none", "You said none; it is ball 1."),
    ],
)
def test_a_question_of_a_chapter(still, name, setting, said, words, answered):
    """The answer is the solver's; it is told after the balls have moved, to whoever let them go."""
    tab = still(chapter=name)
    asked = tab.locator(".cradle-explorer").first
    if setting:
        tab.act(f"read('{setting}')")
    trace = collide(*chain_of(tab.drawn()))
    back = [str(ball) for ball, velocity in enumerate(trace.velocities, 1) if velocity < 0]
    told = str(trace.collisions.sum()) if name == "multiple_impacts" else " and ".join(back)
    if name == "patterns":
        told = f"ball{'s' * (len(back) > 1)} {told}" if back else "none"
    assert words.endswith(f"{told}.")
    before = chain_of(tab.drawn())[0].velocities.tolist()  # those before the hit
    assert tab.bars()[: len(before)] == before
    assert tab.state("covered")
    assert tab.inner_text(".question .told") == ""  # nothing is told before the hit
    if answered:
        tab.choose(said)
    asked.get_by_role("button", name="Next hit", exact=True).click()
    tab.drawn()
    assert not tab.state("covered")
    told = words if answered else f"Answer: {told}."
    assert tab.inner_text(".question .told") == told
    # Screen readers hear it once, however often all is drawn.
    tab.evaluate(
        "new MutationObserver(() => (globalThis.again = true))"
        ".observe(document.querySelector('.question .told'), { childList: true })"
    )
    tab.evaluate(f"{EXPLORER}.changed()")
    tab.drawn()
    assert tab.evaluate("globalThis.again") is None
    asked.get_by_role("button", name="Next hit", exact=True).click()  # the first one was asked for
    tab.drawn()
    assert tab.inner_text(".question .told") == told


def test_events_are_listed(still):
    """In their order; a press goes there."""
    tab = still(chapter="n_balls")
    tab.act("read('speeds=1,0.8,0&restitution=0.25&forward=0.15')")  # of chapter 4
    trace = collide(*chain_of(tab.drawn()))
    rows = [
        (row, f"contact {c + 1}\u2011{c + 2} {'closes' if kind == 'close' else 'ends'}")
        for row, (kind, c) in enumerate(trace.events, start=1)
        if kind != "maximum_compression"
    ]
    assert tab.locator(".events button").all_inner_texts() == [words for _, words in rows]
    for number, (row, _) in enumerate(rows):
        tab.locator(".events button").nth(number).click()
        tab.drawn()
        assert tab.bars() == trace.path[row].round(2).tolist()
        assert float(tab.locator(".scrub input").input_value()) == number + 1
    # Lines have their bends at equal distances, and marks stand apart.
    for contact in ("all", "0", "1"):
        tab.locator(".pictures select").select_option(contact)
        tab.drawn()
        line = tab.locator(".pictures polyline").first.get_attribute("points")
        steps = np.diff([float(point.split(",")[0]) for point in line.split()])
        assert steps == pytest.approx(steps[0], abs=0.02)
        assert len(steps) == len(rows)
        named = tab.locator(".pictures text.small").all()
        boxes = [mark.bounding_box() for mark in named]
        for left, right in itertools.pairwise(boxes):
            assert left["x"] + left["width"] <= right["x"]
    # Neighbours are equally fast where their contact is compressed most.
    tops = tab.locator(".pictures .mark").filter(has=tab.locator("circle")).all()
    for top in tops:
        heights = [float(circle.get_attribute("cy")) for circle in top.locator("circle").all()]
        assert heights == pytest.approx([heights[0]] * 2, abs=0.02)
    # What is moved by hand comes to the event of that number.
    tab.locator(".scrub input").fill("3")
    tab.drawn()
    assert tab.bars() == trace.path[rows[2][0]].round(2).tolist()


def test_events_that_share_an_instant_are_marked_together(still):
    tab = still(chapter="n_balls")
    tab.act("read('speeds=1,0.5,0,0&forward=0')")
    trace = collide(*chain_of(tab.drawn()))
    total = trace.path_impulses.sum(axis=1)
    rows = [k for k, event in enumerate(trace.events, 1) if event.kind != "maximum_compression"]
    shared = [[np.isclose(total[row], total[other]) for other in rows] for row in rows]
    assert np.sum(shared) == len(rows) + 2  # two of them share one
    buttons = tab.locator(".events button").all()
    for button, expected in zip(buttons, shared, strict=True):
        button.click()
        tab.drawn()
        assert [one.get_attribute("aria-pressed") == "true" for one in buttons] == expected


@pytest.mark.parametrize("name", ["n_balls", "problem"])
def test_the_first_hit_stays_beside_its_text(still, name):
    """The balls swing on; pictures and numbers stay, until the reader asks for the next hit."""
    tab = still(chapter=name, stopped=True)
    after = collide(*chain_of(tab.later(50))).velocities.round(2).tolist()
    for button in ("Let go", "Pause", "Go on", "Slow motion"):
        tab.push(button, 1000)
        for _ in range(9 if button == "Slow motion" else 2):
            tab.later(1000)
        running = button != "Pause"
        assert (tab.state("clock.playing"), tab.state("view.number")) == (running, 0)
        assert tab.bars()[: len(after)] == after
    assert tab.state("clock.time") > tab.evaluate("cradleExplorer.Swing.time(0)")
    for number in (2, 3):
        tab.push("Next hit", 50)
        assert tab.inner_text(".outcome :is(h2, h3, h4)") == f"After hit {number} (m/s)"


def test_a_contact_waits_at_ratio_zero(still):
    """Until its driver ends it closes in name only (R6): its impulse does not grow."""
    tab = still(chapter="n_balls")
    for ratio in ("0.15", "0"):
        tab.act(f"read('speeds=1,0.5,0,0&forward={ratio}')")
        trace = collide(*chain_of(tab.drawn()))
        impulses = trace.path_impulses
        told = []
        for row, (kind, c) in enumerate(trace.events, start=1):
            idle = kind == "close" and impulses[row + 1, c] == impulses[row, c]
            words = {"end": "ends", "close": "waits" if idle else "closes"}.get(kind)
            told += [f"contact {c + 1}\u2011{c + 2} {words}"] * bool(words)
        assert tab.locator(".events button").all_inner_texts() == told
        assert sum("waits" in words for words in told) == (0 if float(ratio) else 2)


def test_each_chain_of_chapter_7_is_guessed(still):
    tab = still(chapter="experiments")
    tab.drawn()
    first = ".cradle-explorer[data-guess]"  # below it is one whose ratios can be changed
    options = tab.locator(".walk option").all_inner_texts()
    assert len(options) == 10
    for chain in options[:3]:
        tab.locator(".walk select").select_option(chain)
        tab.drawn()
        assert tab.locator(f"{first} .pictures").is_hidden()
        tab.get_by_role("button", name="Next hit", exact=True).first.click()
        after = tab.drawn()["after"]
        assert tab.bars(f"{first} .outcome .drawn") == np.round(after, 2).tolist()


# A setting that does each task, in the order of the page.
TASKS = (
    "speeds=1,0,0&forward=0.5",
    "speeds=1,0,0&masses=4,2,1&forward=0",
    "speeds=1,0,0,0,0&restitution=0.7&forward=0",
    "speeds=1,0,0&masses=1.12,1,1&forward=0.1",
    "speeds=1,0,0,0&law=spheres&gap=0",
    "speeds=1,0,0&masses=1,0.02,10&forward=0.15",
)


def test_tasks_are_judged_by_the_solver(still):
    tab = still()
    tab.drawn()
    done = ".tasks li.done"
    assert tab.locator(".tasks li").count() == len(TASKS)
    assert tab.locator(done).count() == 0
    for k, setting in enumerate(TASKS):
        tab.act(f"read('{setting}')")
        tab.drawn()
        assert tab.locator(done).count() == k, setting  # not before the hit
        assert tab.inner_text(".task-told") == ""
        tab.push("Next hit")
        tab.drawn()
        told = tab.inner_text(".task-told")
        assert re.fullmatch(rf"\u2713 Done: task (\d and )?{k + 1}", told)
        assert tab.locator(done).count() == k + 1, setting
        assert tab.locator(f".tasks li:nth-of-type({k + 1}).done").count() == 1, setting
    assert f"{len(TASKS)} of {len(TASKS)} done" in tab.inner_text(".tasks summary")
    # Two balls that are pulled do none of them.
    nothing = (
        "(({setting, swing, record}) => cradleExplorer.tasksDone(setting, swing.hit(0), record))"
    )
    tab.act("read('speeds=1,1,0&forward=0.5')")
    tab.drawn()
    assert not any(tab.evaluate(f"{nothing}({EXPLORER}.state)"))
    # A ratio above its bound is that of the bound; to be faster by a tenth is to be faster.
    for setting, tasks in (
        ("masses=10,9.5,0.5&forward=0.15", [1]),
        ("masses=1.2,1,0.8&forward=0.15", [2]),
    ):
        tab.act(f"read('speeds=1,0,0&{setting}')")
        tab.drawn()
        met = tab.evaluate(f"{nothing}({EXPLORER}.state)")
        assert [k for k, yes in enumerate(met, 1) if yes] == tasks, setting
    # Nor do three balls that stick together: they collide again and again, and leave alike.
    tab.act("read('speeds=1,0,0&restitution=0')")
    tab.drawn()
    assert not any(tab.evaluate(f"{nothing}({EXPLORER}.state)"))


@pytest.mark.parametrize("width", [390, 1280])
def test_no_other_button_comes_under_the_pointer(still, width):
    tab = still("", width=width)
    tab.drawn()
    before = tab.middle("button.main")
    tab.push("Let go")
    tab.act("step()")
    tab.drawn()
    assert tab.locator(".run button:visible").count() > 4
    after = tab.locator("button.main").bounding_box()
    assert abs(after["x"] + after["width"] / 2 - before[0]) < after["width"] / 2 - 5
    assert tab.evaluate(
        "([x, y]) => document.elementFromPoint(x, y).matches('button.main')", before
    )


def test_two_cradles_side_by_side(still):
    """The other one has its own ratio, or what was kept; both are the solver's."""
    tab = still("#speeds=1,0,0&forward=0.3")
    kept = tab.drawn()["after"]
    tab.unfold()
    other = ".outcome > div:not(.drawn, .balance) .plot >> nth=0 >> css="
    three = Chain([1] * 3, [1, 0, 0])
    for label, expected in (
        ("ratio 0.15", collide(three, ImpulseCorrelation(0.15)).velocities),
        ("spheres that touch", collide(three, SpringChain()).velocities),
        ("a copy of this setting", kept),
    ):
        tab.choose(label)
        assert tab.bars(other) == np.round(expected, 2).tolist()
    tab.get_by_label("ratio", exact=True).press("Home")
    tab.drawn()
    assert tab.bars(other) == np.round(kept, 2).tolist()
    assert tab.bars() == [0, 0, 1]
    tab.choose("nothing")
    assert tab.locator(".other").is_hidden()


def test_what_a_typed_speed_takes_along_goes_back(still):
    """By keys, too: a ball takes those in its way along, and gives back what was there."""
    tab = still("#scene=one")
    tab.get_by_title("ball 3", exact=True).click()
    tab.drawn()
    for speed, row in (("1.5", [1.5, 1.5, 1.5, 0, 0]), ("0.5", [1, 0.5, 0.5, 0, 0])):
        tab.typed("comes in with", speed)
        assert tab.drawn()["speeds"] == row
    tab.typed("comes in with", "-7")
    said = tab.locator(".refused", has_text="speed")
    assert said.inner_text() == "speed must lie between \u22122 and 2 m/s. In force: 0.5 m/s."
    tab.typed("comes in with", "0")
    assert tab.drawn()["speeds"] == [1, 0, 0, 0, 0]
    for key in ("ArrowLeft", "ArrowRight", "ArrowRight", "ArrowLeft"):
        tab.locator(".ball[data-ball='2']").press(key)
    assert tab.drawn()["speeds"] == [1, 0, 0, 0, 0]


def test_a_hit_is_heard(still):
    tab = still("#speeds=0.5,0,0,0,0&forward=0", stopped=True)
    tab.later(50)
    tab.evaluate(
        """() => {
          globalThis.clicks = [];
          const node = () => ({ connect: (next) => next, start() {}, stop() {}, frequency: {},
            gain: { setValueAtTime: (x) => clicks.push(x), exponentialRampToValueAtTime() {} } });
          globalThis.AudioContext = class { createOscillator = node; createGain = node; };
        }"""
    )
    tab.push("Let go", 2000)
    assert tab.evaluate("clicks") == []  # off by default
    tab.push("Sound", 4000)
    assert tab.evaluate("clicks")
    assert set(tab.evaluate("clicks")) == {0.25}  # half of the loudest, as the speed is
    tab.push("Pull back")
    tab.push("Slow motion", 50)
    tab.evaluate("clicks.length = 0")
    tab.push("Let go", 7000)  # the first hit begins and ends
    assert tab.evaluate("clicks") == [0.25]
    tab.evaluate("AudioContext.prototype.close = () => clicks.push('closed'), null")
    tab.push("Sound")
    assert tab.evaluate("clicks") == [0.25, "closed"]
