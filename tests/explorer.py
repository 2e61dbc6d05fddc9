"""The live explorer's page in a browser; no test depends on how fast the machine is.

Where time matters the page gets a clock that stands still until the test moves it.
"""

import re

import numpy as np
from chains import random_chains, uniform

from cradle import Chain, ImpulseCorrelation, collide

EXPLORER = "cradleExplorer.live[0]"
SETTING = f"{EXPLORER}.state.setting"


def disc(ball: int) -> str:
    """The selector of a ball, counted from 0."""
    return f".ball[data-ball='{ball}'] .disc"


# A frame may change sizes and so ask for another one; sweeps and maps take many. With a swing in
# motion there is no last one: see `Tab.later`.
AT_REST = f"""async () => {{
  for (let frame = 0; frame < 10000; frame += 1) {{
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
    if (!{EXPLORER}.frame) return true;
  }}
  return false;
}}"""


class Tab:
    """A page with a live cradle, as Playwright has it, and what tests do with it and ask it."""

    def __init__(self, page):
        self.page = page

    def __getattr__(self, name):
        return getattr(self.page, name)

    def state(self, what: str):
        """Return a part of the cradle's state."""
        return self.evaluate(f"{EXPLORER}.state.{what}")

    def act(self, what: str):
        """Let a method change the state, as a control does."""
        self.evaluate(f"{EXPLORER}.state.{what}, {EXPLORER}.changed()")

    def shown(self):
        """Return the setting and its outcome."""
        return self.evaluate(f"({{...{SETTING}, after: {EXPLORER}.state.swing.hit(0).after}})")

    def drawn(self):
        """Wait until the page has nothing more to draw, and return its setting and outcome."""
        assert self.evaluate(AT_REST), "the page never comes to rest"
        return self.shown()

    def later(self, milliseconds: int):
        """Let time pass on a page whose clock stands still, and return what is shown then."""
        self.clock.run_for(milliseconds)
        return self.shown()

    def go_to(self, fragment: str, wait: int = 0):
        """Change the address, as a link does, until the page has heard of it; see `push`."""
        self.evaluate(
            """(fragment) => new Promise((done) => {
              addEventListener("hashchange", () => done(), { once: true });
              location.hash = fragment;
            })""",
            fragment,
        )
        if wait:
            self.clock.run_for(wait)

    def push(self, name: str, wait: int = 0):
        """Click on a button; where the clock stands still so many milliseconds may pass then."""
        self.get_by_role("button", name=name, exact=True).click()
        if wait:
            self.clock.run_for(wait)

    def choose(self, words: str):
        """Click on one of several, when it stands still, and return what is then shown."""
        self.locator(".choice label", has_text=re.compile(f"^{re.escape(words)}$")).click()
        return self.drawn()

    def unfold(self):
        """Open the fold of what is set more rarely."""
        self.locator(".settings summary").click()

    def typed(self, label: str, text: str, key: str = "Enter"):
        """Type into the box beside a slider, end with a key, and return the box."""
        box = self.get_by_label(f"{label}, as a number", exact=True)
        box.fill(text)
        box.press(key)
        return box

    def middle(self, selector: str) -> tuple[float, float]:
        box = self.locator(selector).bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def grab(self, selector: str, beside: float = 0.0) -> tuple[float, float]:
        """Press the mouse on the middle of an element, or beside it; return where the middle is."""
        x, y = self.middle(selector)
        self.mouse.move(x + beside, y)
        self.mouse.down()
        return x, y

    def drag(self, selector: str, x: float = 0.0, y: float = 0.0):
        """Press the mouse on an element, move it so far, and let it go."""
        left, top = self.grab(selector)
        self.mouse.move(left + x, top + y, steps=4)
        self.mouse.up()

    def bars(self, selector: str = ".outcome .drawn") -> list[float]:
        """Return the numbers that a picture of bars shows."""
        texts = self.locator(f"{selector} text.number").all_text_contents()
        return [float(text.replace("\u2212", "-")) for text in texts]


def chain_of(setting) -> tuple[Chain, ImpulseCorrelation]:
    chain = Chain(setting["masses"], setting["speeds"], setting["restitution"])
    return chain, ImpulseCorrelation(setting["forward"], setting["backward"], excess="saturate")


def same_outcome(setting) -> bool:
    return collide(*chain_of(setting)).velocities.tolist() == setting["after"]


def settings(count: int):
    """Random settings as the page knows them: balls pulled back in any order that they can keep."""
    rng = np.random.default_rng(31)
    for k in range(count):
        n = 2 + k % 6
        rows = random_chains(rng, 1, n, decades=2)
        masses, _, e, forward, backward = (row[0].tolist() for row in rows)
        yield {
            "masses": masses,
            "speeds": np.sort(uniform(rng, -1, 1, n))[::-1].tolist(),
            "restitution": e,
            "forward": forward,
            "backward": backward,
            "letters": "-" * n,
        }
