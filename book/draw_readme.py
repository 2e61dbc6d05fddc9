"""Draw the pictures of README.md and of instructors.md: `python book/draw_readme.py`."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from cradle import Chain, ImpulseCorrelation, SpringChain, collide, swing
from cradle.pictures import impacts as figures
from cradle.pictures.animation import Animation, animate_swing

PICTURE = Path(__file__).parent / "_static" / "cradle.png"
FILM = PICTURE.with_name("toy.svg")
LECTURE = PICTURE.with_name("lecture.svg")
#: Inches that fit a phone.
SIZE = 3.97, 4.2


def draw() -> Figure:
    """Draw three equal elastic balls at ratio .15 from the first contact to the last."""
    chain = Chain(masses=[1, 1, 1], velocities=[1, 0, 0], restitution=1)
    trace = collide(chain, ImpulseCorrelation(forward=0.15))
    fig = Figure(figsize=(8, 4.2), layout="constrained")
    ax = figures.velocities(trace, fig.subplots())
    ax.get_legend().remove()
    total = trace.path_impulses.sum(axis=1)
    ax.set_xlim(0, 1.28 * total[-1])
    for ball, velocity in enumerate(trace.velocities):
        text = f"  ball {ball + 1}: {velocity:.2f} m/s".replace("-", "−")
        style = {
            "color": figures.PALETTE[ball],
            "weight": "bold",
            "va": "center",
        }
        ax.text(total[-1], velocity, text, **style)
    for row, event in enumerate(trace.events, start=1):
        marker, _, name = figures.EVENT_STYLES[event.kind]
        ax.axvline(total[row], color="0.7", lw=0.8, ls=":")
        pair = trace.path[row, event.contact : event.contact + 2]
        ax.plot(
            [total[row]] * 2,
            pair,
            marker,
            mfc="white",
            mec="black",
            zorder=3,
        )
        ax.annotate(
            f"{event.contact + 1}-{event.contact + 2}: {name}", (total[row], 1), (0, 4),
            xycoords=ax.get_xaxis_transform(), textcoords="offset points",
            fontsize=8, ha="center",
        )  # fmt: skip
    return fig


def film() -> Animation:
    """Show the toy for four seconds: five equal steel balls that touch, one pulled back."""
    toy, times = Chain([1] * 5, [0] * 5), np.linspace(0, 4, 101)
    run = swing(toy, SpringChain(), [-0.06, 0, 0, 0, 0], times)
    return animate_swing(run, speed=0.5)


def lecture() -> Figure:
    """Draw the lecture of instructors.md: three outcomes, all outcomes, what the ratio does."""
    chain = Chain(masses=[1, 1, 1], velocities=[1, 0, 0], restitution=1)
    ratios = np.append(0.5 * (1 - np.linspace(1, 0, 101) ** 2), 0.15)
    after = np.array(
        [collide(chain, ImpulseCorrelation(a)).velocities for a in ratios]
    )
    closing = -np.diff(after)
    way = np.radians(np.linspace(0, 360, 361))
    way = np.array([np.cos(way), np.sin(way)])
    way /= np.sqrt(1 + way[0] * way[1])  # u2^2 + u2 u3 + u3^2 = 1
    fig = Figure(figsize=SIZE, layout="constrained")
    above, below = fig.subfigures(2, height_ratios=(4, 5))
    panels, (arc, curves) = above.subplots(1, 3), below.subplots(1, 2)
    arc.plot(*way, "--", color="0.4", lw=1)
    arc.plot(*closing[:-1].T, color="black", lw=3)
    arc.plot(1, 0, "*", color="black", ms=10)
    arc.text(0.82, 0, "before", fontsize=9, ha="right", va="center")
    for ax, name, k in zip(panels, "ABC", (0, -1, 100), strict=True):
        ax.bar(range(1, 4), after[k], color=figures.PALETTE[:3])
        ax.axhline(0, color="black", lw=0.8)
        ax.set_title(f"{name}: ratio {ratios[k]:g}", fontsize=10)
        ax.set(xlabel="ball", xticks=[1, 2, 3])
        arc.plot(*closing[k], "o", color="black", mfc="white")
        arc.annotate(
            name, closing[k], (8 if k == 0 else -8, -10), fontsize=10,
            textcoords="offset points", ha="center", va="center",
        )  # fmt: skip
        curves.axvline(ratios[k], color="0.7", lw=0.8, zorder=0)
        curves.text(ratios[k], 1.12, name, fontsize=10, ha="center")
    for ball, height in enumerate((-0.33, 0.35, 0.82)):
        style = figures.ball_style(ball)
        curves.plot(ratios[:-1], after[:-1, ball], **style)
        words = {"color": style["color"], "fontsize": 9, "ha": "center"}
        curves.text(0.3, height, f"ball {ball + 1}", **words)
    for ax in (*panels, curves):
        ax.set(ylim=(-0.45, 1.1), yticks=[0, 1])
    for ax in (panels[0], curves):
        ax.set_ylabel("velocity (m/s)")
    for ax in panels[1:]:
        ax.set_yticklabels([])
    curves.set(xlabel="ratio")
    curves.set_xticks([0, 0.25, 0.5], ["0", ".25", ".5"])
    sides = {"xticks": [-1, 0, 1], "xlim": (-1.45, 1.3)}
    sides |= {"yticks": [-1, 0, 1], "ylim": (-1.45, 1.3)}
    arc.set(
        xlabel="$u_2$ (m/s)", ylabel="$u_3$ (m/s)", aspect="equal", **sides
    )
    return fig


if __name__ == "__main__":
    # No version and no date inside: the same picture at every run.
    draw().savefig(PICTURE, dpi=200, metadata={"Software": None})
    film().save(FILM)
    with mpl.rc_context({"svg.hashsalt": "cradle"}):
        nothing = {"Creator": None, "Date": None}
        lecture().savefig(LECTURE, metadata=nothing)
