"""The live explorer's page in a browser: how tests open it, and what they ask it.

No test depends on how fast the machine is. Where time matters, the page gets a clock that stands
still until the test moves it; elsewhere tests wait for a state.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from chains import random_chains, uniform
from test_layout import PATIENCE

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


@pytest.fixture(scope="module", name="page")
def address_of_page(html: Path) -> str:
    """Return the address of the explorer's page."""
    return (html / "book" / "explorer.html").as_uri()


@pytest.fixture(name="visit")
def visits(request, page):
    """Open the page; at the end: no error on the console, and no request that leaves the disk."""
    browser = request.getfixturevalue("browser")
    contexts, faults = [], []

    def open_page(fragment="", *, address=page, width=1400, height=900, stopped=False, **options):
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        context.set_default_timeout(PATIENCE)
        contexts.append(context)
        tab = context.new_page()
        if stopped:  # for dates, timers and frames alike; `tab.clock.run_for` lets time pass
            tab.clock.install(time=0)
            tab.clock.pause_at(10**6)
        tab.on("console", lambda said: said.type == "error" and faults.append(said.text))
        tab.on("pageerror", lambda error: faults.append(str(error)))
        tab.on("request", lambda r: r.url.startswith(("file:", "data:")) or faults.append(r.url))
        if address != page:
            # A chapter: seconds go into its equations, which are not looked at here.
            tab.route("**/tex-svg-full.js", lambda route: route.fulfill(body=""))
        tab.goto(address + fragment)
        if options.get("java_script_enabled", True):
            tab.wait_for_function("globalThis.cradleExplorer?.live?.length > 0")
        return tab

    yield open_page
    for context in contexts:
        context.close()
    assert not faults


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


def colour(node, name: str) -> str:
    """Return a colour of an element as it is shown: #rrggbb."""
    shown = node.evaluate("(node, name) => getComputedStyle(node)[name]", name)
    return "#" + "".join(f"{int(part):02x}" for part in re.findall(r"\d+", shown)[:3])
