"""`cradle swing`: a swinging cradle, as a table or a film."""

import math
from typing import Any

import click

import cradle
from cradle.advice.choice import made
from cradle.command import describe
from cradle.command.console import format_options, picture, show
from cradle.command.describe import chain_options, described, numbers_of, one_or_all
from cradle.input.values import ABOVE_ZERO, one_number, whole_number


@click.command(params=chain_options("speed", "velocities"))
@click.option("--pull", callback=numbers_of, help="How many balls are pulled aside: 2 at the left "
              "end; 0,1 one at the right; 1,1 one at each [1].")  # fmt: skip
@click.option("--by", default=0.05, help="How far, m along the arc, at most a quarter of a "
              "circle [0.05].")  # fmt: skip
@describe.swing_options("0.3")
@click.option("--damping", callback=numbers_of, help="Of each swing's amplitude, 1/s [0].")
@click.option("--seconds", default=2.0, help="How long it swings [2].")
@click.option("--steps", type=int, help="How many rows to print after the start [20].")
@click.option("--output", "-o", type=click.Path(dir_okay=False), callback=picture,
              help="Draw a film to a file: .gif, .mp4, .html, .svg; .png is a picture of the "
              "start.")  # fmt: skip
@format_options
def swing(
    pull: list[float] | None, by: float, gaps: list[float] | None, damping: list[float] | None,
    seconds: float, steps: int | None, output: str | None, as_json: bool, as_csv: bool,
    **options: Any,
) -> None:  # fmt: skip
    """Positions of a swinging cradle, impact after impact.

    Five equal balls, if none are named.  Those that are pulled aside are let go.

    \b
    Examples:
      cradle swing 5 --pull 2 -o toy.gif
      cradle swing 5 --gaps 0.001 --damping 0.05 --period 1.1 --seconds 10
      cradle swing ABACA --by 0.03 --seconds 1
      cradle swing --masses 1,1,1,1,1 --csv
    """
    if output and (as_json or as_csv or steps is not None):
        raise click.UsageError("--output draws a film; --json, --csv and --steps are of tables")
    options["sequence"] = options["sequence"] or (None if options["masses"] else "5")
    length = describe.pendulum_length(options.pop("length"), options.pop("period"))
    length = 0.3 if length is None else length
    hanging = cradle.Pendulums(length, gaps=one_or_all(gaps or [0.0]),
                               damping=one_or_all(damping or [0.0]))  # fmt: skip
    far, frequency = float(hanging.reach(1)[0]), math.sqrt(hanging.gravity / length)
    rule = f"must be above 0 and at most a quarter of a circle of that --length, {far:.4g} m"
    one_number("--by", by, rule, 0.0, far, open_low=True)
    options["speed"] = by * frequency  # of the first strike, to which a restitution belongs
    given = described(**options)
    chain = given.taken
    one_number("--seconds", seconds, *ABOVE_ZERO)
    steps = whole_number("--steps", 20 if steps is None else steps)
    if output:
        from cradle.pictures.animation import animate_swing  # what is missing is said before work

        # Twenty keyframes a swing.
        steps = math.ceil(20 * seconds * frequency / math.tau)
    places = _released(pull or [1.0], by, len(chain))
    balls = cradle.Chain(chain.masses, [0.0] * len(chain), chain.restitution)
    times = [seconds * k / steps for k in range(steps + 1)]
    if (count := seconds * frequency / math.tau) > 2000:
        click.echo(f"cradle: {count:.3g} swings take a while (--seconds)", err=True)
    run = cradle.swing(balls, given.model, places, times, pendulums=hanging)
    rows = [
        {"time": float(time), **{f"ball {k + 1}": float(x) + 0.0 for k, x in enumerate(places)}}
        for time, places in zip(run.times, run.positions, strict=True)
    ]
    impacts = [
        {"time": float(one.time), "before": one.before.tolist(), "after": one.after.tolist()}
        for one in run.impacts
    ]
    # How fast the first ball strikes follows from the pull.
    together = describe.as_one(max(pull or [1.0]) > 1, gaps, options["model"])
    assumed = [one for one in given.assumed if "strikes" not in one]
    if isinstance(given.model, cradle.SpringChain):
        if gaps and not options["stiffness"]:
            together.append("strikes are over before a gap closes (--stiffness)")
        if options["stiffness"] and not run.lasting:
            together.append("strikes take no time: contacts so soft push for too long to follow")
    told = given._replace(assumed=(*assumed, *together))
    extra = {"model": made(given.model), "assumed": told.assumed, "impacts": impacts}
    wide = f"; gaps {hanging.gaps} m" * bool(gaps)
    if output:
        animate_swing(run).save(output)
        click.echo(f"drawn to {output}; impacts: {len(impacts)}\n{told.note}")
    else:
        note = f"impacts: {len(impacts)}; positions in m, times in s{wide}\n{told.note}"
        show(rows, extra, note, as_json, as_csv)
    if run.ended != "times":  # also where the table goes to a file
        click.echo(f"cradle: ended at {run.end:g} s, after {len(impacts)} impacts", err=True)


def _released(pull: list[float], by: float, size: int) -> list[float]:
    """Return where the balls are let go, so many pulled from the left end and from the right."""
    left, right = [*pull, 0.0][:2]
    wrong = len(pull) > 2 or any(one < 0.0 or not one.is_integer() for one in pull)
    if wrong or not 0 < left + right <= size:
        raise click.UsageError(f"--pull {str(pull)[1:-1]}: it says how many of the {size} balls "
                               "are pulled, 2 or 1,1; how far is --by")  # fmt: skip
    return [-by] * int(left) + [0.0] * int(size - left - right) + [by] * int(right)
