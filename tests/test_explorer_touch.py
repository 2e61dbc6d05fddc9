"""The live explorer under fingers: two at once, and those that only scroll the page."""

import numpy as np
import pytest
from explorer import EXPLORER, SETTING, disc, same_outcome


class Hand:
    """Fingers on a phone's screen, each at a place of its own."""

    def __init__(self, tab):
        self.tab, self.places = tab, {}
        self.session = tab.context.new_cdp_session(tab.page)

    def _send(self, kind):
        points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in self.places.items()]
        self.session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def down(self, finger: int, place):
        self.places[finger] = tuple(place)
        self._send("touchStart")

    def move(self, finger: int, x: float, y: float, steps: int = 6):
        """Move by so many pixels."""
        start = self.places[finger]
        for step in range(1, steps + 1):
            share = step / steps
            self.places[finger] = start[0] + share * x, start[1] + share * y
            self._send("touchMove")
            self.tab.drawn()

    def up(self, finger: int):
        del self.places[finger]
        self._send("touchEnd")


@pytest.fixture(name="phone")
def phones(still):
    return lambda fragment="": still(fragment, width=390, has_touch=True, is_mobile=True)


def test_two_fingers_pull_two_balls(phone):
    """Each follows its own finger, and one that is let go stays where it was pulled to."""
    tab = phone("#speeds=0,0,0,0,0&forward=0.1")
    tab.drawn()
    hand, (left, y), (right, _) = Hand(tab), tab.middle(disc(0)), tab.middle(disc(4))
    hand.down(1, (left, y))
    hand.move(1, -60, 0)
    first = tab.drawn()["speeds"]
    assert first[0] > 0.4
    assert first[1:] == [0] * 4
    hand.down(2, (right, y))
    hand.move(2, 60, 0)
    both = tab.drawn()["speeds"]
    assert both[0] == first[0]
    assert both[4] < -0.4
    assert both[1:4] == [0] * 3
    hand.move(1, 10, 0)  # while the other one is held
    assert 0 < tab.drawn()["speeds"][0] < first[0]
    assert tab.drawn()["speeds"][1:] == both[1:]
    hand.up(2)
    hand.move(1, 10, 0)
    shown = tab.drawn()
    assert 0 < shown["speeds"][0] < first[0]
    assert shown["speeds"][1:] == both[1:]
    hand.up(1)
    assert same_outcome(tab.drawn())
    assert tab.drawn()["speeds"] == shown["speeds"]


def test_a_ball_follows_the_finger_as_the_mouse(still, phone):
    """The page does not scroll under it."""
    mouse, tab = still("#scene=one", width=390), phone("#scene=one")
    x, y = mouse.grab(disc(4))
    mouse.mouse.move(x + 80, y, steps=20)
    by_mouse = mouse.drawn()["speeds"][4]
    assert by_mouse < -0.5
    mouse.mouse.up()
    tab.evaluate(
        "document.querySelector('.stage')"
        ".addEventListener('pointercancel', () => (globalThis.lost = true))"
    )
    show_middle(tab, disc(4))
    scrolled, hand = tab.evaluate("scrollY"), Hand(tab)
    hand.down(1, tab.middle(disc(4)))
    hand.move(1, 80, 0, steps=20)
    shown = tab.drawn()
    hand.up(1)
    assert tab.evaluate("globalThis.lost") is None
    assert shown["speeds"][4] == pytest.approx(by_mouse, abs=0.15)  # a finger is still at first
    assert tab.evaluate("scrollY") == scrolled


# What is pressed, and how much room it has: height, and the width or the way to its neighbour.
TARGETS = """(kinds) => [...document.querySelectorAll(kinds)]
  .filter((node) => node.checkVisibility())
  .map((node) => {
    const { left, width, height } = node.getBoundingClientRect();
    return [node.outerHTML.slice(0, 80), left, width, height];
  })"""


@pytest.mark.parametrize("size", [(375, 667), (375, 812), (812, 375)])
@pytest.mark.parametrize("name", ["explorer", "intro"])
def test_a_phone_shows_balls_and_bars_at_once(still, name, size):
    """And the button that lets go, below the bar of the page; what is pressed is large enough."""
    options = {"width": size[0], "height": size[1], "has_touch": True, "is_mobile": True}
    tab = still("#speeds=1,0,0,0,0,0,0" * (name == "explorer"), chapter=name, **options)
    tab.drawn()
    tab.evaluate("document.querySelector('.stage').scrollIntoView({ behavior: 'instant' })")
    covered = tab.locator(".bd-header-article").first.bounding_box()
    tab.evaluate(f"scrollBy({{ top: -{covered['height']}, behavior: 'instant' }})")
    for button in ("Next hit", "Guess first", "Let go"):
        if tab.get_by_role("button", name=button).count():
            tab.push(button)
        if tab.state("clock.playing"):
            tab.push("Pause")
        tab.drawn()
        for part in (".stage", ".outcome .drawn", ".run .main"):
            box = tab.locator(part).first.bounding_box()
            assert covered["height"] - 1 <= box["y"] <= size[1] - box["height"], (button, part)
    host = ".cradle-explorer "
    kinds = "button, summary, select, input:not(.choice input, .handles input), .choice label"
    for node, _, width, height in tab.evaluate(TARGETS, f"{host}:is({kinds})"):
        assert min(width, height) >= 43.9, node
    balls = tab.evaluate(TARGETS, f"{host}.ball .disc")
    for (_, left, *_), (_, right, *_) in zip(balls[1:], balls[2:], strict=False):
        assert right - left >= 24
    least = {"explorer": 28, "intro": 40}[name]  # of seven balls, and of five
    for node, _, width, height in tab.evaluate(TARGETS, f"{host}.handles input"):
        assert min(width, height) >= least, node
    # Numbers of balls: all in one line, none below the others.
    counts = tab.locator(".choice", has_text="number of balls").locator("label").all()
    tops = [round(count.bounding_box()["y"]) for count in counts]
    assert tops == tops[:1] * (6 if name == "explorer" else 0)


def test_a_finger_takes_the_nearest_ball(phone):
    """Where places to touch overlap."""
    tab = phone("#speeds=0,0,0,0,0,0,0")
    tab.drawn()
    show_middle(tab, disc(3))
    hand, (x, y) = Hand(tab), tab.middle(disc(3))
    hand.down(1, (x + 6, y))
    hand.move(1, -60, 0)
    assert np.sign(tab.drawn()["speeds"]).tolist() == [1, 1, 1, 1, 0, 0, 0]


def test_a_second_finger_on_the_same_ball_is_none(phone):
    tab = phone("#speeds=0,0,0,0,0&forward=0.1")
    tab.drawn()
    hand, (x, y) = Hand(tab), tab.middle(disc(0))
    hand.down(1, (x - 3, y))
    hand.down(2, (x + 3, y))
    hand.move(2, -60, 0)
    assert tab.drawn()["speeds"] == [0] * 5
    hand.move(1, -60, 0)
    assert tab.drawn()["speeds"][0] > 0.4


def show_middle(tab, place: str):
    tab.locator(place).evaluate(
        "(node) => node.scrollIntoView({ block: 'center', behavior: 'instant' })"
    )


@pytest.mark.parametrize("place", [".drags-x svg", ".map svg", disc(3)])
def test_scrolling_past_a_picture_changes_nothing(phone, place):
    """Up or down, with the slant of a thumb: the page scrolls and the experiment stays."""
    tab = phone("#scene=map&picture=map" if "map" in place else "#scene=half")
    tab.go_to("speeds=1,0,0&picture=map" if "map" in place else "speeds=1,0,0,0,0&picture=sweep")
    before = tab.drawn()
    show_middle(tab, place)
    x, y = tab.middle(place)
    scrolled = tab.evaluate("scrollY")
    hand = Hand(tab)
    hand.down(1, (x + 40 if "map" in place else x, y))
    hand.move(1, 12, -150, steps=8)
    hand.up(1)
    tab.wait_for_function("(before) => scrollY > before + 40", arg=scrolled)
    assert tab.drawn() == before
    assert tab.state("clock.time") == 0


@pytest.mark.parametrize(("place", "row"), [(".drags-x svg", "forward"), (".map svg", "masses")])
def test_a_tap_and_a_finger_to_the_side_do_their_work(phone, place, row):
    tab = phone("#speeds=1,0,0&picture=" + ("map" if "map" in place else "sweep"))
    before = tab.drawn()
    show_middle(tab, place)
    x, y = tab.middle(place)
    hand = Hand(tab)
    hand.down(1, (x + 20, y - 20))
    hand.up(1)
    tapped = tab.drawn()
    assert tapped[row] != before[row]
    hand.down(1, (x, y))
    hand.move(1, 60, 0)
    hand.up(1)
    moved = tab.drawn()
    assert moved[row] != tapped[row]
    assert same_outcome(moved)


def test_another_setting_while_a_ball_is_held(still):
    """Typed, or followed as a link: balls that are gone are let go, the others stay in the hand."""
    tab = still("#scene=one")
    x, y = tab.grab(disc(4))
    tab.mouse.move(x + 40, y, steps=4)
    held = tab.drawn()["speeds"]
    assert held[4] < 0
    # Other masses stay in force while it is pulled further.
    for label, number in (("mass", "3"), ("restitution", "0.5")):
        tab.get_by_label(f"{label}, as a number", exact=True).evaluate(
            "(box, value) => { box.value = value; box.dispatchEvent(new Event('change')); }", number
        )
    tab.mouse.move(x + 50, y)
    shown = tab.drawn()
    assert shown["speeds"][4] < held[4]
    assert shown["masses"] == [3] * 5
    assert shown["restitution"] == [0.5] * 4
    # Fewer balls, before and after the next frame.
    for wait in (lambda: None, lambda: tab.drawn()):
        tab.act("read('speeds=1,0')")
        wait()
        tab.mouse.move(x + 60, y)
        assert tab.drawn()["speeds"] == [1, 0]
    tab.mouse.up()
    assert tab.drawn()["speeds"] == [1, 0]
    assert "NaN" not in tab.evaluate(f"{EXPLORER}.host.outerHTML + JSON.stringify({SETTING})")
