"""Sphinx extension: the live explorer.

A page asks for it by one line, `<div class="cradle-explorer" data-scene="one"></div>`. The build
adds the scripts to that page and, for readers without scripts, a picture of the scene drawn from
the solver. Scenes, the paper's balls and the colours are written once, here and in `cradle`; the
page gets them as `_static/explorer_data.js`.
"""

import json
import re
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from docutils import nodes
from sphinx.application import Sphinx

#: In this order: the solver, the data, and each script after those it uses.
SCRIPTS = (
    "explorer_engine.js",
    "explorer_spheres.js",
    "explorer_data.js",
    "explorer_setting.js",
    "explorer_swing.js",
    "explorer_words.js",
    "explorer_plots.js",
    "explorer_fields.js",
    "explorer_stage.js",
    "explorer_controls.js",
    "explorer_panels.js",
    "explorer_pictures.js",
    "explorer_guess.js",
    "explorer_tasks.js",
    "explorer_state.js",
    "explorer.js",
)

#: The last one lays out what the others style.
STYLES = ("explorer_controls.css", "explorer_pictures.css", "explorer.css")

PLACE = re.compile(
    r'<div class="cradle-explorer"[^>]*data-scene="(?P<scene>[^"]*)"[^>]*>'
)

PICTURE = re.compile(r'_static/explorer-(\w+)\.svg"')


def equal(
    count: int, ratio: float, pulled: int = 1, e: float = 1.0
) -> dict[str, Any]:
    """Return a setting of equal balls, the first ones pulled back."""
    return {
        "masses": [1.0] * count,
        "speeds": [1.0] * pulled + [0.0] * (count - pulled),
        "restitution": [e] * (count - 1),
        "forward": [ratio] * (count - 2),
        "backward": [ratio] * (count - 2),
        "letters": "-" * count,
    }


@cache
def speeds(count: int) -> str:
    """Return how equal steel balls leave if the striker comes at 1 m/s."""
    from cradle import Chain, SpringChain, collide

    chain = Chain([1] * count, [1] + [0] * (count - 1))
    *others, last = (
        f"{v:.2f}".replace("-", "\N{MINUS SIGN}")
        for v in collide(chain, SpringChain()).velocities
    )
    return f"{', '.join(others)} and {last} m/s"


#: The link after the texts that speak of steel balls; its address is seen from the explorer's page.
STEEL = {
    "address": "intro.html#a-toy-on-your-desk",
    "words": "A toy on your desk",
}


def story() -> list[dict[str, Any]]:
    """Return the scenes that walk through the book's story."""
    light = equal(3, 0.15)
    light["masses"] = [1.0, 0.03, 1.0]
    meeting = equal(4, 0.1)
    meeting["speeds"] = [1.0, 0.5, 0.0, 0.0]
    told = [
        ("example", "The example of this book", equal(3, 0.15), "inside",
         "While ball 2 is being pushed, it passes a part of the push on: this part is the ratio, "
         "here 0.15. Move it: at 0 ball 3 leaves alone; at 0.5 balls 2 and 3 leave together, and "
         "ball 1 comes back faster."),
        ("one", "Pull back one ball", equal(5, 0.0), "inside",
         "Now five balls. One strikes, and one leaves at the other end, as the textbooks say: the "
         "balls collide one pair after the other. This is the ratio 0. "
         "Steel balls that touch do not do this."),
        ("two", "Pull back two balls", equal(5, 0.0, 2), "inside",
         "Two balls strike, and two leave. The ratio is still 0. Pull back three, and one of them "
         "never stops."),
        ("small", "A small ratio", equal(5, 0.15), "inside",
         "With 0.15 the last ball takes most of the motion, and the first comes back a little. Of "
         "all scenes this is nearest to steel balls that touch; by Hertz's law, without loss, they "
         f"leave with {speeds(5)}. With one ratio for all, balls 2 and 3 never come back."),
        ("half", "The ratio one half", equal(5, 0.5), "sweep",
         "Half of each push goes on at once. The last two balls leave together, and the first one "
         "bounces back. Energy and momentum are the same as at the ratio 0."),
        ("three", "Three balls, two answers", equal(3, 0.5), "sweep",
         "Energy and momentum do not say what three balls do. Move the ratio from one half to 0: "
         "both textbook answers are here, and everything between them."),
        ("losses", "With losses", equal(5, 0.15, e=0.9), "inside",
         "Now two balls part more slowly than they met. Let the balls swing for a while: they end "
         "up swinging together, as real ones do."),
        ("light", "A light ball in the middle", light, "inside",
         "A ball of three hundredths of the mass rattles between its heavy neighbours: one hit, a "
         "dozen collisions. Make it lighter still, and count them."),
        ("meeting", "Two runs that meet", meeting, "inside",
         "The first ball comes in at full speed, the second at half of it: Fig. 8 of the paper. "
         "For a while balls 1 and 2 push each other, and so do balls 3 and 4; between them nothing "
         "pushes, until balls 2 and 3 are equally fast."),
        ("map", "Who bounces back?", equal(3, 0.15, e=0.5), "map",
         "Which balls come back depends on two quotients of masses. Drag the point over the map, "
         "which is Fig. 6 of the paper."),
    ]  # fmt: skip
    return [
        dict(
            zip(
                ("key", "title", "setting", "picture", "text"),
                scene,
                strict=True,
            ),
            link=STEEL if scene[0] in ("one", "small") else None,
        )
        for scene in told
    ]


def measured() -> list[dict[str, Any]]:
    """Return the paper's ten chains as scenes."""
    from cradle import paper_chain
    from cradle.tables import paper_sequences

    scenes = []
    for sequence, figure in paper_sequences().items():
        chain, model = paper_chain(sequence, excess="saturate")
        setting = {
            "masses": chain.masses.tolist(),
            "speeds": chain.velocities.tolist(),
            "restitution": chain.restitution.tolist(),
            "forward": list(model.forward),
            "backward": list(model.backward),
            "letters": sequence,
        }
        text = (
            f"A chain of Fig. {figure} of the paper. The letters name its balls; their masses, "
            "restitutions and ratios are those that its authors measured."
        )
        scenes.append(
            {
                "key": sequence,
                "title": sequence,
                "setting": setting,
                "picture": "inside",
                "text": text,
                "paper": True,
            }
        )
    return scenes


def chapters() -> list[dict[str, Any]]:
    """Return scenes of single chapters, which are not walked through."""
    meets = equal(3, 0.15, e=0.25)
    meets["speeds"] = [1.0, 0.8, 0.0]
    bounce = equal(3, 0.15, e=0.5) | {"masses": [0.4, 1.0, 4.0]}
    runs = equal(4, 0.15) | {"speeds": [1.0, 0.5, 0.0, 0.0]}
    springs = equal(3, 0.15) | {"law": "springs", "stiffness": 1.0}
    told = [
        ("meets", "Balls that meet again", meets, "inside"),
        ("bounce", "Which balls go back?", bounce, "map"),
        ("runs", "Two runs that meet", runs, "inside"),
        ("springs", "Three balls on springs", springs, "inside"),
    ]
    keys = ("key", "title", "setting", "picture")
    return [dict(zip(keys, scene, strict=True), text="") for scene in told]


def data() -> dict[str, Any]:
    """Return all that the page does not compute itself."""
    from cradle.pictures.impacts import EVENT_STYLES, PALETTE, ball_style
    from cradle.tables import ball_masses, ratio_table, restitution_table

    pairs = restitution_table().stack()
    ratios = ratio_table()
    dashes = [ball_style(ball)["linestyle"] for ball in range(len(PALETTE))]
    return {
        "scenes": [*story(), *measured()],
        "chapters": chapters(),
        "masses": dict(ball_masses()),
        "restitution": {x + y: float(e) for (x, y), e in pairs.items()},
        "ratios": dict(
            zip(ratios.triplet, ratios.ratio.tolist(), strict=True)
        ),
        "palette": list(PALETTE),
        "dashes": [
            [] if dash == "solid" else list(dash[1]) for dash in dashes
        ],
        "events": {
            kind: [letter, name]
            for kind, (_, letter, name) in EVENT_STYLES.items()
        },
    }


def draw(setting: dict[str, Any], path: Path) -> None:
    """Draw a scene for readers without scripts: the balls, and their velocities during the hit."""
    from matplotlib.figure import Figure

    from cradle import Chain, ImpulseCorrelation, SpringChain, collide
    from cradle.pictures import impacts as figures

    chain = Chain(
        setting["masses"], setting["speeds"], setting["restitution"]
    )
    model = ImpulseCorrelation(
        setting["forward"], setting["backward"], excess="saturate"
    )
    if "stiffness" in setting:
        ratios = np.arange(len(chain) - 1)
        model = SpringChain(setting["stiffness"] ** ratios, 1)
    figure = Figure(
        figsize=(7, 5.4), layout="constrained", facecolor="white"
    )
    row, diagram = figure.subplots(2, 1, height_ratios=[1, 2.2])
    letters = setting["letters"].replace("-", "")
    sketch(chain, row, letters)
    figures.velocities(collide(chain, model), diagram)
    figure.savefig(path, metadata={"Date": None})


def sketch(chain: Any, ax: Any, letters: str) -> None:
    """Draw a chain as a row of balls: radii as for one density, arrows for velocities."""
    from matplotlib.patches import Circle

    from cradle.pictures.impacts import ball_style

    radii = 0.5 * np.cbrt(chain.masses / np.max(chain.masses))
    centres = np.cumsum(2 * radii) - radii
    speeds = chain.velocities / (np.abs(chain.velocities).max() or 1.0)
    for k, (x, radius) in enumerate(zip(centres, radii, strict=True)):
        colour = ball_style(k)["color"]
        ax.add_patch(Circle((x, 0), radius, fc="0.93", ec=colour, lw=2))
        name = letters[k] if letters else str(k + 1)
        # A name that does not fit in its ball stands above it.
        height = 0 if radius > 0.2 else radius + 0.12
        ax.text(x, height, name, ha="center", va="center")
        if speeds[k]:
            ends = [(x + way * 0.45 * speeds[k], 0.68) for way in (1, -1)]
            arrow = {"arrowstyle": "-|>", "color": "black"}
            ax.annotate("", *ends, arrowprops=arrow)
    right = centres[-1] + radii[-1] + 0.2
    ax.set(xlim=(-0.2, right), ylim=(-0.7, 0.9), aspect="equal")
    ax.set_axis_off()


def add_scripts(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Give a page with an explorer its scripts, and the pictures for readers without them."""
    body = context.get("body", "")
    if not PLACE.search(body):
        return
    root = context["pathto"]("_static", resource=True)
    content = data()
    scenes = {
        scene["key"]: scene
        for scene in content["scenes"] + content["chapters"]
    }

    def with_picture(match: re.Match[str]) -> str:
        scene = scenes[match["scene"]]
        alt = escape(
            f"{scene['title']}: the balls, and their velocities during the first hit.",
            quote=True,
        )
        return (
            f'{match[0]}<noscript><img src="{root}/explorer-{scene["key"]}.svg" alt="{alt}">'
            "</noscript>"
        )

    context["body"] = PLACE.sub(with_picture, body)
    for style in STYLES:
        app.add_css_file(style)
    for script in SCRIPTS:
        app.add_js_file(script, loading_method="defer")


def write_data(app: Sphinx, exception: Exception | None) -> None:
    """Write the data of the page and the pictures of its scenes."""
    if exception is not None or app.builder.format != "html":
        return
    static = Path(app.outdir, "_static")
    content = data()
    text = json.dumps(content, separators=(",", ":"))
    (static / "explorer_data.js").write_text(
        f"globalThis.cradleExplorer = {{ data: {text} }};\n",
        encoding="utf-8",
    )
    scenes = {
        scene["key"]: scene
        for scene in content["scenes"] + content["chapters"]
    }
    pages = Path(app.outdir).glob("**/*.html")
    shown = {
        key
        for page in pages
        for key in PICTURE.findall(page.read_text(encoding="utf-8"))
    }
    for key in sorted(shown):
        draw(scenes[key]["setting"], static / f"explorer-{key}.svg")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.connect("html-page-context", add_scripts)
    app.connect("build-finished", write_data)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
