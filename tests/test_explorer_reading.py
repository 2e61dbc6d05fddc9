"""The live explorer for every reader: address, keys, words, widths, modes, motion, no scripts."""

import itertools
import re
from urllib.parse import unquote

import numpy as np
import pytest
from explorer import EXPLORER, SETTING, chain_of, disc, same_outcome, settings
from pages import FRAMES, MISFITS, code, colour, contrast, show

from cradle import Chain, SpringChain, collide, paper_chain, post_impact_velocities
from cradle.measures import bouncing_pattern


def test_address_keeps_the_setting(still):
    tab, address = still("", stopped=True), ""
    other = still()
    for setting in settings(6):
        tab.evaluate(f"(setting) => ({EXPLORER}.state.set(setting), {EXPLORER}.changed())", setting)
        before = tab.later(190)
        assert tab.evaluate("location.hash") == address  # not at every step of a slider
        tab.clock.run_for(50)
        address = tab.evaluate("location.hash")
        other.go_to(unquote(address).removeprefix("#"))
        after = other.drawn()
        assert after == before
        assert {name: after[name] for name in setting} == setting
    assert still(unquote(address)).drawn() == before


def test_a_link_is_followed_while_an_address_is_due(still):
    """The address is written late, and maybe just before the page hears of a new one."""
    tab = still()
    tab.drawn()
    tab.get_by_label("ratio", exact=True).press("ArrowRight")
    tab.drawn()
    tab.evaluate(
        f"""(fragment) => new Promise((done) => {{
          const later = setTimeout;
          let write;
          globalThis.setTimeout = (act) => (write = act);
          {EXPLORER}.written = "";
          {EXPLORER}.writeAddress();
          globalThis.setTimeout = later;
          addEventListener("hashchange", () => done(), {{ once: true }});
          location.hash = fragment;
          write();
        }})""",
        "speeds=1,0",
    )
    assert tab.drawn()["speeds"] == [1, 0]


WRONG_ADDRESSES = {
    "restitution=1.2": "restitution[0] = 1.2; must lie in [0, 1]",
    "masses=1,2&speeds=1,0,0": "speeds has 3 values; 2 balls need 2",
    "speeds=0,1": "speeds[1] = 1; must not exceed the one before it",
    "speeds=1": "1 ball; must be 2 to 7",
    "masses=": "masses[0] = NaN; must lie in [0.01, 100]",
    "masses=1e400": "masses[0] = Infinity; must lie in [0.01, 100]",
    "restitution=1e-40": "restitution[0] = 1e-40",
    "letters=ABXBA": "letters = ABXBA",
    "alpha=0.1": "alpha is no part of a setting",
    "toString=1": "toString is no part of a setting",
    "=3": "a value without a name is no part of a setting",
    "law=toString": "law = toString; must be rule or spheres or springs",
    "speeds=1, ,0": "speeds[1] = NaN",
    "speeds=1,%": "speeds[1] = NaN",
    "scene=none": "scene is no part of a setting",
    "speeds=1e-300,0": "speeds[0] = 1e-300; must be 0 or at least 0.000001 in size",
    "speeds=0,-1e-200": "speeds[1] = -1e-200; must be 0 or at least 0.000001 in size",
    "letters=ABABA&masses=1": "masses[0] = 1; ball A has 0.045 kg",
}


def test_wrong_addresses_are_refused(still):
    tab = still("#speeds=%E0%A4,0")
    tab.drawn()
    assert "speeds[0] = NaN" in tab.inner_text(".words")
    for fragment, reason in WRONG_ADDRESSES.items():
        tab.go_to(fragment)
        shown = tab.drawn()
        assert reason in tab.inner_text(".words"), fragment
        assert same_outcome(shown), fragment
    tab.go_to("&speeds=1,0,0&&")
    assert tab.drawn()["speeds"] == [1, 0, 0]
    tab.go_to("speeds%3D1%2C0")  # as some mail programs write it
    assert tab.drawn()["speeds"] == [1, 0]


def test_letters_bring_their_numbers(linked):
    """A link may name the paper's balls and nothing else; a ball of another mass has no letter."""
    tab = linked("letters=ABACA")
    found = tab.drawn()
    chain, model = paper_chain("ABACA", excess="saturate")
    asked = chain_of(found)
    assert asked[0].masses.tolist() == chain.masses.tolist()
    assert asked[0].restitution.tolist() == chain.restitution.tolist()
    assert asked[1] == model
    tab.go_to("letters=AB-&restitution=0.5")
    found = tab.drawn()
    assert (found["masses"], found["restitution"]) == ([*chain.masses[:2], 1], [0.5, 0.5])


def test_a_reader_walks_on_from_a_changed_setting(still):
    """An address stays until something changes; then keys go on from the last scene."""
    tab = still("#what-you-see", stopped=True)
    tab.clock.run_for(1000)
    assert tab.evaluate("location.hash") == "#what-you-see"
    tab.go_to("scene=half", 1000)
    tab.get_by_label("ratio", exact=True).press("ArrowRight")
    tab.clock.run_for(1000)
    assert "forward=0.5" in tab.evaluate("location.hash")
    assert tab.locator(".walk select").input_value() == ""
    assert tab.inner_text(".scene-text") == ""
    tab.push("next scene", 1000)
    assert tab.locator(".walk select").input_value() == "three"


def test_a_scene_has_its_own_settings_alone(still):
    """No name of another one comes up where a setting happens to be the same; a link gives it."""
    tab = still()
    chosen = tab.locator(".walk select")
    for ratio, scene in (("0.5", ""), ("0.15", "example")):
        tab.typed("ratio", ratio)
        tab.drawn()
        assert chosen.input_value() == scene
    tab.typed("ratio", "0.5")
    tab.drawn()
    assert still("#" + tab.state("fragment()")).locator(".walk select").input_value() == "three"
    groups = tab.evaluate(
        """[...document.querySelectorAll('.walk optgroup')].map(
          ({ children }) => [...children].map(({ value }) => value))"""
    )
    assert len(groups) == 2
    assert all(re.fullmatch("[A-D]+", key) for key in groups[1])  # the paper's, at the end


def test_outcome_is_said_in_words(still):
    """Polite, once the reader pauses, and the same words as on the screen."""
    tab = still("#scene=three", stopped=True)
    said = tab.locator(".said [aria-live=polite]")
    slider = tab.get_by_label("ratio", exact=True)
    slider.focus()
    tab.clock.run_for(1000)
    tab.evaluate(
        """(() => {
          window.heard = [];
          const said = document.querySelector('.said [aria-live]');
          new MutationObserver(() => heard.push(said.textContent)).observe(said, {childList: true});
        })()"""
    )
    for _ in range(12):
        slider.press("ArrowLeft")
        tab.clock.run_for(600)
    assert tab.evaluate("heard") == []
    shown = tab.later(150)
    words = said.text_content()
    assert words == tab.locator(".words").text_content()
    assert tab.evaluate("heard") == [words]
    after = [f"{abs(v):.2f}" for v in shown["after"]]
    assert re.findall(r"\d\.\d\d", words.partition("After it")[2])[:3] == after
    assert "All energy is kept." in words
    assert "ball 1 moves left" in words.partition("After it")[2]


def test_everything_by_keyboard(still):
    tab = still("#scene=one")
    tab.unfold()
    tab.evaluate("document.querySelector('.walk button').focus()")
    expected = "next scene, pull of ball 1, pull of ball 5, Let go, Next hit, 5, all, mass, "
    expected += "restitution, ratio, any, Inside the hit, Copy Python"
    for name in expected.split(", "):
        tab_to(tab, name)
    # A ball moves by keys, shows that it has them, and says what it does.
    ball = tab.locator(".ball[data-ball='0']")
    ball.focus()
    for key, speed in (("ArrowLeft", 1.1), ("Shift+ArrowRight", 1.05)):
        tab.keyboard.press(key)
        assert tab.drawn()["speeds"][0] == speed
    assert tab.evaluate(REACH) == "3px"
    assert ball.get_attribute("aria-valuetext") == "comes in at 1.05 m/s"
    ring, disc = (float(ball.locator(part).get_attribute("r")) for part in (".reach", ".disc"))
    assert ring >= disc + 6
    # Walk, let go, step.
    tab.locator(".walk button").first.focus()
    tab.keyboard.press("ArrowRight")
    tab.drawn()
    assert tab.locator(".walk select").input_value() == "two"
    for _ in range(2):
        tab.keyboard.press(".")
        tab.drawn()
    assert tab.locator(".outcome h2").first.inner_text() == "After hit 2 (m/s)"


def test_a_button_that_has_done_its_work_keeps_the_focus(still):
    tab = still(stopped=True)
    tab.push("Let go", 1000)
    back = tab.get_by_role("button", name="Pull back", exact=True)
    back.press("Space")
    tab.clock.run_for(100)
    assert back.get_attribute("aria-disabled") == "true"
    assert tab.evaluate("document.activeElement.textContent") == "Pull back"


def test_buttons_that_stay_pressed_say_so(still):
    tab = still()
    for name in ("Slow motion", "Guess first", "Sound"):
        for pressed in ("true", "false"):
            tab.push(name)
            tab.drawn()
            assert tab.get_by_role("button", name=name).get_attribute("aria-pressed") == pressed


def test_full_screen_for_a_lecture(still):
    """Everything in one window, in letters that are seen from afar, and page keys walk on."""
    tab = still(width=1366, height=768)
    tab.push("Full screen")
    tab.wait_for_function("document.fullscreenElement")
    for count in range(1, 20):
        tab.keyboard.press("PageDown")
        tab.drawn()
        assert tab.inner_text(".place") == f"{count + 1} of 20"
        scrolls = tab.evaluate("[document.fullscreenElement.scrollHeight, innerHeight]")
        assert scrolls[0] <= scrolls[1] + 1, tab.locator(".walk select").input_value()
    letters = tab.evaluate(
        """(() => {
          const says = (node) =>
            [...node.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim());
          return [...document.querySelectorAll('.cradle-explorer *')]
            .filter((node) => node.checkVisibility() && says(node))
            .map((node) => parseFloat(getComputedStyle(node).fontSize) / innerHeight);
        })()"""
    )
    assert len(letters) > 30
    assert min(letters) > 0.016  # of the wall's height


# The scene, or none for a setting of one's own; whether the balls are let go; whether they
# have been under way.
STATE = (
    f"""(({{ view, clock }}) => [view.scene, clock.playing, clock.time > 0])({EXPLORER}.state)"""
)
FULL = "document.fullscreenElement !== null"
# The name of what has the focus.
FOCUSED = """(() => {
  const node = document.activeElement;
  return node.getAttribute("aria-label") || node.labels?.[0]?.textContent || node.textContent;
})()"""
REACH = "getComputedStyle(document.activeElement.querySelector('.reach')).strokeWidth"


def full_screen(still):
    """Go to full screen with the mouse; time stands still."""
    tab = still(width=1366, height=768, stopped=True)
    tab.later(50)
    tab.push("Full screen")
    return hear(tab, full=True)


def hear(tab, full: bool):
    """Wait until the page has been told of full screen, which comes after the screen is full."""
    label = "Leave full screen" if full else "Full screen"
    tab.wait_for_function(f"({FULL}) === {str(full).lower()}")
    for _ in range(100):
        tab.later(20)
        if tab.inner_text(".full") == label:
            return tab
    pytest.fail(f"the button does not say {label}")


def take(tab, scene: str):
    tab.act(f"take('{scene}')")
    return tab.later(50)


def touch(tab, selector: str, way: int = 0):
    """Press the mouse on an element, move it to the side, and let it go."""
    tab.drag(selector, way)
    return tab.later(50)


def tab_to(tab, name: str):
    """Press Tab until the element of this name has the focus."""
    for _ in range(60):
        tab.keyboard.press("Tab")
        if tab.evaluate(FOCUSED) == name:
            return
    pytest.fail(f"Tab does not reach {name}")


def test_space_after_a_click_on_full_screen(still):
    """It lets the balls go: the button does not keep the keys, unless one comes to it with Tab."""
    tab = full_screen(still)
    assert tab.evaluate("document.activeElement.matches('.cradle-explorer')")  # for Enter, too
    tab.keyboard.press("Space")
    assert tab.evaluate(STATE) == ["example", True, False]
    tab.later(50)
    assert tab.evaluate(FULL)
    assert tab.inner_text(".full") == "Leave full screen"
    for key in ("Space", "Enter"):
        tab_to(tab, "Leave full screen")
        for full in (False, True):
            before = tab.evaluate(STATE)
            tab.keyboard.press(key)
            assert tab.evaluate(STATE) == before
            hear(tab, full)


def test_keys_of_a_lecture_after_the_mouse(still):
    """In full screen what the mouse has pressed leaves the keys to the lecture."""
    tab = full_screen(still)
    # What the keys do in the second scene, from which one can walk both ways.
    walks = {"ArrowRight": "small", "ArrowLeft": "one", "PageDown": "small", "PageUp": "one"}
    done = {key: [scene, False, False] for key, scene in walks.items()}
    done |= {".": [False, True], "Space": [True, False]}
    pressed_before = {
        disc(0): -30,
        disc(4): 0,
        ".run button:has-text('Slow motion')": 0,
        ".settings input[type=range] >> nth=1": 20,
        ".settings label[title='ball 2']": 0,
        ".pictures label:has-text('Each ratio')": 0,
    }
    # After the first all keys, after each other those that it may have a use of its own for.
    own = "ArrowRight", ".", "Space"
    for (selector, way), (key, state) in itertools.product(pressed_before.items(), done.items()):
        if key not in own and selector != disc(0):
            continue
        take(tab, "two")
        before = touch(tab, selector, way)
        tab.keyboard.press(key)
        assert tab.evaluate(STATE)[-len(state) :] == state, (selector, key)
        if key not in walks:
            assert tab.state("setting") == {name: before[name] for name in tab.state("setting")}
            assert tab.evaluate("document.activeElement === document.body")  # none looks chosen
    assert tab.evaluate(FULL)


def test_keys_of_a_lecture_after_tab(still):
    """In full screen a ball that Tab has reached keeps the arrows, and a button the space bar."""
    tab = full_screen(still)
    take(tab, "two")
    touch(tab, disc(4), 30)
    take(tab, "two")
    tab_to(tab, "pull of ball 1")
    for key, speed in (("ArrowLeft", 1.1), ("ArrowRight", 1)):
        tab.keyboard.press(key)
        assert tab.later(50)["speeds"] == [speed, 1, 0, 0, 0]
    assert tab.evaluate(REACH) == "3px"
    pressed(
        tab, (".", "two", False, True), ("PageUp", "one", False, False),
        ("PageDown", "two", False, False), ("Space", "two", True, False),
        ("Space", "two", False, False),
    )  # fmt: skip
    tab_to(tab, "Next hit")
    pressed(tab, ("Space", "two", False, True), ("ArrowLeft", "one", False, False))


def pressed(tab, *steps):
    """Press keys, each given with the state that it leads to."""
    for key, *state in steps:
        tab.keyboard.press(key)
        assert tab.evaluate(STATE) == state, key


def test_keys_of_a_lecture_on_the_page(still):
    """They work after a click into the cradle; page keys scroll, and a ball keeps the arrows."""
    tab = still(stopped=True)
    take(tab, "two")
    pressed(tab, ("ArrowRight", "two", False, False))
    tab.click(".words")
    pressed(tab, ("ArrowRight", "small", False, False), ("ArrowLeft", "two", False, False))
    tab.later(50)
    touch(tab, disc(4))
    pressed(
        tab, (".", "two", False, True), ("Space", "two", True, True), ("Space", "two", False, True)
    )
    tab.keyboard.press("ArrowRight")
    assert tab.later(50)["speeds"] == [0, 0, 0, 0, -0.1]  # of a swing the others hang at rest
    take(tab, "two")
    tab.evaluate("scrollTo({ top: 0, behavior: 'instant' })")
    pressed(tab, ("PageDown", "two", False, False))
    tab.wait_for_function("scrollY > 0")


def test_a_box_keeps_the_keys_by_which_one_types(still):
    tab = full_screen(still)
    take(tab, "small")
    box = tab.get_by_label("ratio, as a number", exact=True)
    box.click()
    for key in ("Control+a", "0", ".", "3", "ArrowLeft", "2", "Enter"):
        tab.keyboard.press(key)
    assert tab.later(50)["forward"] == [0.23] * 3
    assert tab.evaluate(STATE) == ["", False, False]


def test_keys_of_a_lecture_after_the_list(still):
    """What a pointer has chosen from the list of scenes is let go by the space bar."""
    tab = full_screen(still)
    chosen = tab.locator(".walk select")
    chosen.dispatch_event("pointerdown")  # a true one opens a window that takes the keys of a test
    chosen.focus()
    chosen.select_option("half")
    tab.keyboard.press("Space")
    assert tab.evaluate(STATE) == ["half", True, False]


@pytest.mark.parametrize("width", [390, 1400])
def test_fits_and_can_be_read(still, width: int):
    tab = still(width=width)
    for scene in ("one", "half", "map", "ABCCAB"):
        tab.go_to(f"scene={scene}")
        tab.drawn()
        for mode in ("light", "dark"):
            show(tab, width, mode)
            assert tab.evaluate(MISFITS) == []
            # Letters of pictures lie inside them, and on each other nowhere.
            cut = tab.evaluate(
                """[...document.querySelectorAll('.cradle-explorer svg text')].filter((node) => {
                  const own = node.getBoundingClientRect();
                  const box = node.ownerSVGElement.getBoundingClientRect();
                  return own.width && (own.left < box.left - 1 || own.right > box.right + 1);
                }).map((node) => node.textContent)"""
            )
            assert cut == []
    for mode, ground in (("light", "#ffffff"), ("dark", "#121212")):
        show(tab, width, mode)
        tab.mouse.move(0, 0)
        assert colour(tab.locator("body"), "backgroundColor") == ground
        for selector, name in (
            (".words", "color"), (".stage .name", "fill"), (".plot text", "fill"),
            (".cradle-explorer button", "color"),
        ):  # fmt: skip
            assert contrast(colour(tab.locator(selector).first, name), ground) > 7
        # The button that stands out does so under a pointer too; a touch leaves one there.
        tab.hover("button.main")
        main = tab.locator("button.main")
        assert contrast(colour(main, "color"), colour(main, "backgroundColor")) > 7


def test_letters_twice_as_large_fit(still):
    """What stands side by side comes one below the other."""
    tab = still(width=640)
    tab.add_style_tag(content="html { font-size: 200% !important }")
    tab.evaluate(f"{EXPLORER}.changed()")
    tab.drawn()
    beyond = tab.evaluate(
        """[...document.querySelectorAll(".cradle-explorer *")].filter((node) =>
          node.checkVisibility() && !node.closest(".unseen")
          && node.getBoundingClientRect().right > innerWidth + 1)
          .map((node) => node.outerHTML.slice(0, 60))"""
    )
    assert beyond == []


def test_marks_can_be_seen(still):
    """Balls, also pale ones, the zone of ratios above their bound, sliders of several values."""
    tab = still("#speeds=1,0,0,0,0,0,0&masses=1,2,1,1,1,1,1&forward=0.9&picture=sweep")
    tab.drawn()
    marks = [(disc(ball), "stroke") for ball in range(7)]
    marks += [(f".outcome .drawn rect[fill='var(--ball-{ball})']", "fill") for ball in range(7)]
    slider = tab.locator(".slider.several input[type=range]").first
    for mode, ground in (("light", "#ffffff"), ("dark", "#121212")):
        show(tab, 1400, mode)
        for selector, how in [*marks, (".held", "stroke")]:
            assert contrast(colour(tab.locator(selector).first, how), ground) >= 3, selector
        share = float(slider.evaluate("(node) => getComputedStyle(node).opacity"))
        mixed = slider.evaluate(
            """(node, [share, ground]) => {
              const own = getComputedStyle(node).accentColor;
              node.style.outlineColor = `color-mix(in srgb, ${own} ${100 * share}%, ${ground})`;
              return getComputedStyle(node).outlineColor;
            }""",
            [share, ground],
        )
        assert contrast(code(mixed), ground) >= 3


@pytest.mark.parametrize("name", ["problem", "patterns"])
def test_the_link_below_a_small_one_is_large_enough(visit, name):
    for touch, least in ((False, 24), (True, 44)):
        tab = visit(chapter=name, width=390, has_touch=touch, is_mobile=touch)
        assert tab.locator(".more a").first.bounding_box()["height"] >= least


@pytest.mark.parametrize("name", ["explorer", "intro", "three_balls", "compliance"])
def test_what_one_moves_is_beside_what_it_changes(still, name):
    """On a phone the sliders and the bars are on one screen; on a desk no sentence is squeezed."""
    tab = still(chapter=name, width=390, height=844, has_touch=True, is_mobile=True)
    tab.push("Next hit")
    tab.drawn()
    host = tab.locator(".cradle-explorer").first
    first = host.locator(".outcome .drawn").bounding_box()["y"]
    label = "stiffness quotient" if name == "compliance" else "ratio"
    last = host.get_by_label(label, exact=True).bounding_box()
    assert first < last["y"] + last["height"] < first + 500
    show(tab, 1280, "light")
    tab.drawn()
    words, desk = (host.locator(part).bounding_box()["width"] for part in (".words", ".desk"))
    assert words > desk * (0.5 if name == "explorer" else 0.95)


def test_motion_is_asked_for(visit):
    lively = visit(stopped=True)
    for scene in ("", "two", "small"):  # each stands still until it is let go
        if scene:
            lively.push("Let go", 1000)
            lively.push("next scene") if scene == "small" else lively.go_to("scene=two")
        lively.clock.run_for(2000)
        assert lively.state("clock.time") == 0
    lively.push("Let go", 1500)
    assert lively.state("clock.time") == pytest.approx(1.5, abs=0.05)
    assert lively.get_by_role("button", name="Pause").is_visible()
    # Out of sight it stands still, and goes on where it was.
    lively.evaluate("document.querySelector('footer').style.marginTop = '3000px'")
    lively.evaluate("document.querySelector('footer').scrollIntoView()")
    lively.wait_for_function(f"!{EXPLORER}.visible")
    lively.clock.run_for(50)
    before = lively.state("clock.time")
    lively.clock.run_for(5000)
    assert lively.state("clock.time") == before
    lively.evaluate("scrollTo(0, 0)")
    lively.wait_for_function(f"{EXPLORER}.visible")
    lively.clock.run_for(500)
    assert lively.state("clock.time") == pytest.approx(before + 0.5, abs=0.05)


def test_motion_by_the_frames_of_the_browser(visit):
    """With the true clock, at whatever pace the machine has."""
    tab = visit("#scene=one")
    tab.push("Let go")
    tab.wait_for_function(f"{EXPLORER}.state.clock.time > 0.8")
    places = tab.state(f"swing.positions({EXPLORER}.state.clock.time)")
    assert places[0] == 0 != places[4]  # one comes, one goes


# Count what is done: impacts solved, panels drawn anew, attributes set and elements made.
COUNT_WORK = f"""(() => {{
  window.work = {{ solved: 0, drawn: 0, changed: 0 }};
  const count = (object, name, key) => {{
    const counted = object[name];
    object[name] = function (...given) {{
      work[key] += 1;
      return counted.apply(this, given);
    }};
  }};
  count(cradle, "collide", "solved");
  count(cradle, "outcome", "solved");
  count({EXPLORER}, "draw", "drawn");
  const size = (node) => 1 + (node.querySelectorAll?.("*").length ?? 0);
  const made = ({{ addedNodes }}) => [...addedNodes].reduce((sum, node) => sum + size(node), 0);
  const watch = {{ attributes: true, characterData: true, childList: true, subtree: true }};
  new MutationObserver((changes) => changes.forEach((one) => (work.changed += 1 + made(one))))
    .observe({EXPLORER}.host, watch);
}})()"""


# Time passes with each look at the clock: half a millisecond.
SLOW_SOLVER = "(() => { let now = 0; performance.now = () => (now += 0.5); })()"


def counted(tab, milliseconds: int) -> dict[str, int]:
    """Let time pass, and return what was done meanwhile, and how many hits there were."""
    hits = f"swing.latest({EXPLORER}.state.clock.time) + 1"
    before = tab.state(hits)
    tab.evaluate("Object.assign(work, { solved: 0, drawn: 0, changed: 0 })")
    tab.clock.run_for(milliseconds)
    return {**tab.evaluate("work"), "hits": tab.state(hits) - before}


def test_work_of_a_frame(visit):
    """Little enough for sixty frames a second: counted, as times depend on the machine."""
    tab = visit("#scene=ABCCAB", stopped=True)
    balls, frames = 6, 125
    tab.push("Let go", 1100)  # beyond the first hit
    tab.evaluate(COUNT_WORK)
    swing = counted(tab, 16 * frames)
    # Each hit is solved twice, for its outcome and for its history, and laid out once. Between hits
    # balls move, and nothing is laid out.
    assert swing["hits"] == swing["drawn"] == 2
    assert swing["solved"] == 4
    assert 2 * balls * frames <= swing["changed"] < 6 * balls * frames
    between = counted(tab, 16 * 20)
    assert between["hits"] == between["solved"] == between["drawn"] == 0
    assert between["changed"] <= 3 * balls * 20
    tab.push("Slow motion")
    slow = counted(tab, 16 * 500)
    # A hit is solved again for its history. Inside it bars and shares of energy are made anew.
    assert slow["hits"] > 0
    assert slow["solved"] == 2 * slow["hits"]
    assert slow["drawn"] <= 1 + 2 * slow["hits"]
    assert slow["changed"] < 20 * balls * 500


def test_contacts_are_marked_while_they_are_pressed(still):
    """In slow motion; at the ratio 0 one after the other, and none between two hits."""
    tab, seen = still("#scene=one", stopped=True), []
    tab.push("Slow motion")
    tab.push("Let go")
    stars = f"{EXPLORER}.stage.stars.map((star) => star.classList.contains('shown'))"
    for _ in range(14):
        tab.later(500)
        seen.append(np.flatnonzero(tab.evaluate(stars)).tolist())
    assert [marked for marked, _ in itertools.groupby(seen)] == [[], [0], [1], [2], [3], []]


def test_what_does_not_move_is_not_drawn(still):
    """Balls at rest, though let go; those beside one that swings; the cradle beside a sweep."""
    tab = still("#speeds=0,0,0,0,0", stopped=True)
    tab.clock.run_for(50)
    tab.evaluate(COUNT_WORK)
    tab.push("Let go", 1000)  # a voice is told once
    assert counted(tab, 2000) == {"solved": 0, "drawn": 0, "changed": 0, "hits": 0}
    assert not tab.evaluate(f"{EXPLORER}.frame")
    tab.go_to("scene=one", 600)
    tab.push("Let go", 75)
    frames = 20
    assert 0 < counted(tab, 16 * frames)["changed"] <= 3 * (frames + 1)  # of one ball in five
    tab.push("Pause", 50)
    tab.click("label:has-text('Each ratio')")
    tab.clock.run_for(50)
    tab.evaluate(SLOW_SOLVER)
    tab.get_by_label("restitution", exact=True).press("ArrowLeft")
    tab.clock.run_for(50)
    tab.evaluate(
        f"new MutationObserver((all) => (window.moved = all.length))"
        f".observe({EXPLORER}.stage.svg, {{ attributes: true, childList: true, subtree: true }})"
    )
    assert counted(tab, 16 * 5)["solved"] > 20
    assert tab.evaluate("window.moved") is None


def test_bars_follow_the_swing(visit):
    """They show each hit, and so do title and words; a voice tells the first one alone."""
    tab = visit("#scene=losses", stopped=True)
    tab.push("Let go", 1000)
    title, said = tab.locator(".outcome h2").first, tab.locator(".said [aria-live=polite]")
    heard = said.text_content()
    assert "Before the first hit" in heard
    for number in range(1, 4):
        tab.clock.run_for(1004)  # half a period
        hit = tab.state(f"swing.hit({number})")
        assert title.inner_text() == f"After hit {number + 1} (m/s)"
        assert tab.bars(".outcome") == pytest.approx(hit["after"], abs=0.0051)
        assert "After it, ball" in tab.inner_text(".words")
        assert tab.inner_text(".words").startswith(f"Before hit {number + 1}, ")
        assert said.text_content() == heard
    tab.push("Pause", 1000)
    assert said.text_content() == tab.inner_text(".words")


def test_sweeps_and_maps_share_the_frame(still):
    """They take seven milliseconds of each frame, however slow the solver is."""
    tab = still(stopped=True)
    tab.clock.run_for(50)
    tab.evaluate(COUNT_WORK)
    tab.evaluate(SLOW_SOLVER)
    for scene in ("half", "map"):
        tab.go_to(f"scene={scene}", 50)
        for _ in range(5):
            assert 0 < counted(tab, 16)["solved"] < 15
    # What is known belongs to its own question: the map begins anew with another ratio.
    painted = """(() => {
      const canvas = document.querySelector(".map canvas");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      return data.filter((value, k) => k % 4 === 3 && value > 0).length;
    })()"""
    before = tab.evaluate(painted)
    tab.get_by_label("ratio", exact=True).press("ArrowRight")
    tab.clock.run_for(16)
    assert 0 < tab.evaluate(painted) < before / 3


def test_what_takes_too_long_is_said(still):
    """Five light balls between two heavy ones take more events than the page computes."""
    masses = "100,0.01,0.01,0.01,0.01,0.01,100"
    fragment = f"#speeds=2,0,0,0,0,0,0&masses={masses}&restitution=0.99&forward=0.02"
    tab = still(fragment, stopped=True)
    tab.clock.run_for(50)
    status = tab.state("swing.hit(0).status")
    assert status == "unfinished"
    assert "more than 4000 events" in tab.inner_text(".words")
    assert tab.locator(".outcome rect").count() == 0  # no stale bars
    assert tab.locator(".pictures polyline").count() == 0
    tab.push("Let go", 300)
    assert tab.get_by_role("button", name="Pause").count() == 1
    tab.clock.run_for(1000)  # the hit comes after half a second
    assert tab.get_by_role("button", name="Pause").count() == 0
    assert tab.state("clock.time") == pytest.approx(0.5, abs=0.01)


def test_map_is_the_solvers(still):
    """Every twentieth cell of the map against Python, and its own point."""
    tab = still("#scene=map")
    tab.locator(".map").scroll_into_view_if_needed()
    found = tab.evaluate(
        f"""() => {{
          const map = new cradleExplorer.RegionMap({SETTING});
          map.points.resume(Infinity);
          return [map.points.finished, [...map.points.values].map((cell) => cell.pattern)];
        }}"""
    )
    assert found[0]
    side = round(len(found[1]) ** 0.5)
    assert side >= 100
    ratio = (np.arange(side) + 0.5) / side * 3
    some = np.arange(0, side, 12)
    left, right = np.meshgrid(ratio[some], ratio[some], indexing="ij")
    masses = np.stack([1 / left, np.ones_like(left), 1 / right], axis=-1)
    after = post_impact_velocities(masses, [1, 0, 0], 0.5, 0.15, excess="saturate")
    back = {1: 1, 2: 0, 3: 2}  # pattern: balls that go back
    expected = np.vectorize(back.get)(bouncing_pattern(after))
    assert np.array_equal(np.reshape(found[1], (side, side))[np.ix_(some, some)], expected)
    assert len(np.unique(expected)) == 3

    # Drag the point to where the first ball bounces back, by pointer and by key.
    tab.drag(".point .present", 20, -60)
    moved = tab.drawn()
    assert moved["masses"][0] < 1
    assert moved["masses"][1] == 1
    assert same_outcome(moved)
    back = sum(velocity < 0 for velocity in moved["after"])
    masses = ", ".join(f"{mass:g}" for mass in moved["masses"])
    said = f"masses {masses} kg; going back: {['none', 'ball 1', 'balls 1 and 2'][back]}"
    assert tab.locator(".point").get_attribute("aria-valuetext") == said
    tab.locator(".point").focus()
    tab.keyboard.press("ArrowRight")
    assert tab.drawn()["masses"][2] < moved["masses"][2]
    assert tab.evaluate("document.activeElement.classList.contains('point')")
    tab.go_to("speeds=1,0,0&masses=0.25,1,2&restitution=0.5&forward=0&picture=map")
    assert abs(tab.drawn()["after"][1]) < 1e-15  # of ball 2 rounding alone is left
    assert tab.locator(".point").get_attribute("aria-valuetext").endswith("going back: ball 1")


def test_sweep_is_the_solvers(linked):
    tab = linked("scene=half")
    setting = tab.drawn()
    values = tab.evaluate(
        f"""() => {{
          const sweep = new cradleExplorer.Sweep({SETTING}, [0, 1, 2]);
          sweep.points.resume(Infinity);
          return [...sweep.points.values].map((answer) => answer.velocities);
        }}"""
    )
    ratios = np.arange(201) / 200
    python = post_impact_velocities(
        setting["masses"], setting["speeds"], 1.0, np.tile(ratios[:, None], 3), excess="saturate"
    )
    np.testing.assert_allclose(values, python, rtol=0, atol=1e-12)


def test_scenes_do_what_their_texts_say(linked):
    """In Python, from the settings that the page has."""
    tab = linked()
    scenes = {scene["key"]: scene for scene in tab.evaluate("cradleExplorer.data.scenes")}
    traces = {key: collide(*chain_of(scene["setting"])) for key, scene in scenes.items()}
    after = {key: trace.velocities for key, trace in traces.items()}
    thirds = [-1 / 3, 2 / 3, 2 / 3]
    for key, expected in (("one", [0, 0, 0, 0, 1]), ("two", [0, 0, 0, 1, 1]), ("three", thirds)):
        np.testing.assert_allclose(after[key], expected, atol=1e-6 * (key == "three"))
    # Steel balls: in m/s; of all rows of five with one ball pulled back "small" is nearest,
    # and at no ratio of the slider balls 2 and 3 come back. Above one half it holds contacts.
    steel = collide(Chain([1] * 5, [1, 0, 0, 0, 0]), SpringChain()).velocities
    text = scenes["small"]["text"].replace("\N{MINUS SIGN}", "-")
    said = re.search(r"leave with (.*) and (.*) m/s", text)
    assert [*said[1].split(", "), said[2]] == [f"{v:.2f}" for v in steel]
    # What the first scene says of its two other ratios.
    example = scenes["example"]["setting"]
    alone, both = (collide(*chain_of(example | {"forward": [a]})).velocities for a in (0, 0.5))
    np.testing.assert_allclose(alone, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(both, thirds, atol=1e-6)
    assert both[0] < after["example"][0] < 0
    rows = {
        key: np.abs(after[key] - steel).max()
        for key, scene in scenes.items()
        if np.array_equal(np.sign(scene["setting"]["speeds"]), [1, 0, 0, 0, 0])
    }
    assert len(rows) > 5
    assert min(rows, key=rows.get) == "small"
    assert steel[:3].max() < -0.01
    everywhere = np.tile(np.arange(101)[:, None] / 100, 3)
    swept = post_impact_velocities([1] * 5, [1, 0, 0, 0, 0], 1, everywhere, excess="saturate")
    assert swept[:, 1:3].min() > -1e-14
    assert np.abs(swept[:51, 1:3]).max() < 1e-14
    assert after["small"][0] < -0.05
    assert 0.9 < after["small"][4] < 1
    assert after["half"][0] < -0.2
    assert after["half"][3] == pytest.approx(after["half"][4], abs=1e-6)
    # For a while contact 2-3 alone does not push; then balls 2 and 3 are equally fast.
    pushes = np.diff(traces["meeting"].path_impulses, axis=0) > 0
    apart = np.flatnonzero((pushes == [True, False, True]).all(axis=1))
    row = traces["meeting"].events.index(("close", 1)) + 1
    assert 0 < apart[0] <= apart[-1] < row
    assert not pushes[apart[0] : row, 1].any()
    assert traces["meeting"].path[row, 1] == pytest.approx(traces["meeting"].path[row, 2])
    # "Make it lighter still": the slider has room, and there are more than the dozen.
    light = scenes["light"]["setting"]
    lightest = tab.evaluate("cradleExplorer.LIMITS.masses[0]")
    assert light["masses"][1] > 2 * lightest
    lighter = collide(*chain_of(light | {"masses": [1, lightest, 1]}))
    assert lighter.collisions.sum() > traces["light"].collisions.sum() == 12
    # "One of them never stops": three of five pulled back, at the ratio 0. And losses: "they end
    # up swinging together."
    middle_ball, together = tab.evaluate(
        """() => {
          const { withRatio, pulled, data, Swing } = cradleExplorer;
          const [one, losses] = ["one", "losses"].map(
            (name) => data.scenes.find(({ key }) => key === name).setting);
          const three = new Swing(pulled(one, 2, 1));
          return [[0, 1, 2, 3].map((k) => Math.abs(three.hit(k).after[2])),
            new Swing(losses).hit(400)];
        }"""
    )
    assert middle_ball == [1, 1, 1, 1]
    assert not together["happened"]
    np.testing.assert_allclose(np.abs(together["after"]), 0.2)


def test_links_of_scenes(linked, html):
    """They lead to a heading that is there."""
    tab, named = linked(), set()
    for scene in tab.evaluate("cradleExplorer.data.scenes"):
        linked(f"scene={scene['key']}").evaluate(FRAMES)
        text = tab.locator(".scene-text")
        assert text.inner_text().startswith(scene["text"][:60])
        for link in text.locator("a").all():
            page, _, heading = link.get_attribute("href").partition("#")
            assert f'<section id="{heading}">' in (html / "book" / page).read_text("utf-8")
            named.add(scene["key"])
    assert named == {"one", "small"}


def test_what_rests_is_said_to_rest(linked):
    """In exact numbers balls 2 and 3 stand still, as the landing page says."""
    tab = linked("scene=small")
    assert tab.drawn()["after"][1:3] == [0, 0]
    words = tab.inner_text(".words")
    assert "balls 2 and 3 rest and" in words
    assert "almost" not in words
    tab = linked("speeds=1,0,0&restitution=0.99999&law=spheres")
    tab.drawn()
    assert "Less than 0.1\u00a0% of the energy is lost." in tab.inner_text(".words")
    tab = linked("speeds=1,0&law=spheres")
    tab.drawn()
    assert "ball 1 rests and" in tab.inner_text(".words")


def test_a_hit_of_many_steps_is_drawn(linked):
    tab = linked("speeds=1,0,0,0,0&masses=20,0.05,20,0.05,20&law=springs&stiffness=0.1")
    assert len(tab.drawn()["after"]) == 5
    assert tab.evaluate(f"{EXPLORER}.state.record.path.length") > 60_000
    assert tab.locator(".pictures polyline:visible").count() == 5  # one for each ball's velocity


@pytest.mark.parametrize(
    ("chapter", "parts"),
    [
        ("intro", {"ratio"}),
        ("problem", {"ratio"}),
        ("three_balls", {"mass", "restitution", "ratio"}),
        ("patterns", {"restitution", "ratio"}),
        ("multiple_impacts", {"restitution", "ratio"}),
        ("n_balls", {"ratio"}),
    ],
)
def test_small_ones_in_chapters(visit, chapter: str, parts: set[str]):
    """They wait to be let go, show what the chapter is about, and leave the address alone."""
    tab = visit(chapter=chapter, width=390, stopped=True)
    tab.clock.run_for(1000)
    count = 2 if chapter == "patterns" else 1  # there the map has a cradle of its own
    assert tab.evaluate("document.querySelectorAll('.cradle-explorer.live').length") == count
    host = tab.locator(".cradle-explorer").first
    labels = host.locator(".slider:visible label").all_text_contents()
    assert set(labels) == parts
    assert tab.state("clock.playing") is False
    before = tab.later(50)
    ratio = host.get_by_label("ratio", exact=True)
    assert ratio.get_attribute("max") == ("0.5" if chapter == "problem" else "1")
    ratio.press("ArrowLeft")
    after = tab.later(1000)
    assert after["forward"] != before["forward"]
    assert same_outcome(after)
    assert tab.evaluate("location.hash") == ""
    page, _, setting = host.locator(".more a").get_attribute("href").partition("#")
    assert page == "explorer.html"
    ratio.press("ArrowLeft")
    assert tab.later(50) != after
    tab.act(f"read('{setting}')")
    assert tab.later(50) == after


def test_the_first_page_does_what_it_says(visit):
    """Let go, ratio 0, drag ball 2: ball 1 comes along, and both swing when they are released."""
    tab = visit(chapter="intro", stopped=True)
    tab.clock.run_for(1000)
    tab.push("Let go")
    assert tab.later(1000)["speeds"] == [1, 0, 0, 0, 0]
    tab.get_by_label("ratio", exact=True).press("Home")
    tab.drag(disc(1), -60, -10)
    shown = tab.later(50)
    assert shown["speeds"][0] == shown["speeds"][1] > 0.5
    assert shown["speeds"][2:] == [0, 0, 0]
    assert tab.state("clock.playing")
    np.testing.assert_allclose(shown["after"], shown["speeds"][::-1], atol=1e-15)


def test_without_scripts_there_is_a_picture(visit):
    tab = visit(java_script_enabled=False)
    picture = tab.locator(".cradle-explorer img")
    assert picture.is_visible()
    assert picture.evaluate("(image) => image.complete && image.naturalWidth") > 400
    assert "velocities" in picture.get_attribute("alt")
