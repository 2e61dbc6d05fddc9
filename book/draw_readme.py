"""Draw the pictures of README.md and of own_code.md: `python book/draw_readme.py`."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cradle import Chain, ImpulseCorrelation, SpringChain, collide, swing
from cradle.pictures import impacts as figures
from cradle.pictures.animation import Animation, animate_swing

PICTURE = Path(__file__).parent / "_static" / "cradle.png"
FILM = PICTURE.with_name("toy.svg")
PLOT = PICTURE.with_name("plot.svg")
#: Inches that fit a phone.
SIZE = 3.97, 3


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


def plot() -> Axes:
    """Draw the first block of own_code.md."""
    chain = Chain(masses=[1, 1, 1], velocities=[1, 0, 0], restitution=0.95)
    ax = collide(chain, ImpulseCorrelation(0.15)).plot()
    ax.figure.set_size_inches(SIZE)
    return ax


if __name__ == "__main__":
    # No version and no date inside: the same picture at every run.
    draw().savefig(PICTURE, dpi=200, metadata={"Software": None})
    film().save(FILM)
    with mpl.rc_context({"svg.hashsalt": "cradle"}):
        nothing = {"Creator": None, "Date": None}
        plot().figure.savefig(PLOT, metadata=nothing)
