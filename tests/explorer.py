"""The live explorer's page in a browser: how tests open it, and what they ask it.

No test depends on how fast the machine is. Where time matters, the page gets a clock that stands
still until the test moves it; elsewhere tests wait for a state.
"""

import re

import numpy as np
from chains import random_chains, uniform

from cradle import Chain, ImpulseCorrelation, collide

EXPLORER = "cradleExplorer.live[0]"
SETTING = f"{EXPLORER}.state.setting"

# A frame may change sizes and so ask for another one; sweeps and maps take many. With a swing in
# motion there is no last one: see `later`.
AT_REST = f"""async () => {{
  for (let frame = 0; frame < 10000; frame += 1) {{
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
    if (!{EXPLORER}.frame) return true;
  }}
  return false;
}}"""


def still(visit, fragment="", **options):
    """Open the page for a reader who asked for less motion: nothing moves by itself."""
    return visit(fragment, reduced_motion="reduce", **options)


def drawn(tab):
    """Wait until the page has nothing more to draw, and return its setting and outcome."""
    assert tab.evaluate(AT_REST), "the page never comes to rest"
    return shown(tab)


def later(tab, milliseconds: int):
    """Let time pass on a page whose clock stands still, and return what is shown then."""
    tab.clock.run_for(milliseconds)
    return shown(tab)


def shown(tab):
    return tab.evaluate(f"({{...{SETTING}, after: {EXPLORER}.state.swing.hit(0).after}})")


def go_to(tab, fragment: str):
    """Change the address, as a link does, and wait until the page has heard of it."""
    tab.evaluate(
        """(fragment) => new Promise((done) => {
          addEventListener("hashchange", () => done(), { once: true });
          location.hash = fragment;
        })""",
        fragment,
    )


def press(tab, name: str):
    tab.get_by_role("button", name=name, exact=True).click()


def choose(tab, words: str):
    """Click on one of several, by its words: when it stands still, and where it is seen."""
    tab.locator(".choice label", has_text=re.compile(f"^{re.escape(words)}$")).click()


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


def middle(tab, selector: str) -> tuple[float, float]:
    box = tab.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def grab(tab, selector: str, beside: float = 0.0) -> tuple[float, float]:
    """Press the mouse on the middle of an element, or beside it; return where the middle is."""
    x, y = middle(tab, selector)
    tab.mouse.move(x + beside, y)
    tab.mouse.down()
    return x, y


def bars(tab, selector: str = ".outcome .drawn") -> list[float]:
    """Return the numbers that a picture of bars shows."""
    texts = tab.locator(f"{selector} text.number").all_text_contents()
    return [float(text.replace("\u2212", "-")) for text in texts]
