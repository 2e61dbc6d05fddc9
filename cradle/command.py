"""The command line: `cradle solve`, `film`, `fit`, `plot` ...; also `python -m cradle`.

Answers go to standard output, errors to standard error.  Exit codes: 0 for an answer, 1 for input
that is wrong or an impact that did not finish, 2 for a command that was not understood.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from cradle.console import plot_fits, show, text
from cradle.describing import chain_options, described
from cradle.filming import film
from cradle.recommending import recommend

# What a command needs is imported in the command: the first answer comes within a second.

# What errors say of arguments, as options.
_OPTIONS = {
    "excess='saturate'": "--saturate", "stiffness=": "--stiffness ", "wanted = ": "--wanted ",
    "model_error = ": "--model-error ", "accuracy = ": "--accuracy ", "forward[": "--ratio[",
    "forward = ": "--ratio = ", "forward has": "--ratio has",
}  # fmt: skip


def _format_options(command: Callable[..., None]) -> Callable[..., None]:
    command = click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")(command)
    return click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")(
        command
    )


@click.group()
@click.version_option(package_name="cradle-companion", prog_name="cradle")
def main() -> None:
    """Impacts in chains of balls: Newton's cradle by the Impulse Correlation Ratio."""


@main.command()
@chain_options
@_format_options
def solve(as_json: bool, as_csv: bool, **options: Any) -> None:
    """Velocities after an impact.

    SEQUENCE names the paper's balls, first ball first, such as ABACA; or give --masses.

    \b
    Examples:
      cradle solve --masses 1,1,1,1,1
      cradle solve ABACA --speed 1
      cradle solve ABCCA --saturate --json
      cradle solve --masses 45,53,53 --unit g --restitution 0.53,0.36 --ratio 0.104
      cradle solve --masses 1,1,1 --velocities 1,0,-1 --model sequential --csv
    """
    from cradle.advice.recommendation import made
    from cradle.models import collide

    # One chain: faster as it stands than the compiler takes to load.
    given = described(**options)
    chain = given.chain
    trace = collide(chain, given.model)
    letters = options["sequence"] or ["-"] * len(chain)
    rows = [
        {"ball": k + 1, "type": letters[k], "mass": float(chain.masses[k]),
         "before": float(chain.velocities[k]), "after": float(trace.velocities[k]) + 0.0}
        for k in range(len(chain))
    ]  # fmt: skip
    extra = {
        "model": made(given.model),
        "assumed": given.assumed,
        # Of balls at rest nothing is lost.
        "energy_lost": float(trace.energy_loss / (chain.kinetic_energy or 1.0)),
        "collisions": trace.collisions.tolist(),
        "collapsed": trace.collapsed,
        "held_contacts": list(trace.saturated),
    }
    still = "" if (chain.closing_speeds > 0.0).any() else "no balls approach: no impact\n"
    note = (
        f"{still}energy lost: {100 * extra['energy_lost']:z.2f} %; collisions of the contacts: "
        f"{', '.join(map(str, extra['collisions']))}\n{given.note}"
    )
    show(rows, extra, note, as_json, as_csv)


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--mass-unit", type=click.Choice(["kg", "g"]), help="Unit of the column mass [kg].")
@click.option("--velocity-unit", type=click.Choice(["m/s", "cm/s", "mm/s"]),
              help="Unit of before, after and sigma [m/s].")  # fmt: skip
@click.option("--sigma", type=float, help="Error of all velocities, for a file without it.")
@click.option("--restitution", "given", multiple=True, metavar="PAIR=E[:ERROR]",
              help="For pairs that were not shot alone: AB=0.53:0.01.")  # fmt: skip
@click.option("--known", multiple=True, metavar="TRIPLET=RATIO", help="Ratios not to be fitted.")
@click.option("--predict", metavar="SEQUENCE", help="Predict a longer chain of these balls.")
@click.option("--speed", default=1.0, help="Of its first ball, m/s [1].")
@click.option("--plot", type=click.Path(dir_okay=False), help="Draw the likelihoods to a file.")
@_format_options
def fit(
    file: Path, given: Sequence[str], known: Sequence[str], predict: str | None, speed: float,
    plot: str | None, as_json: bool, as_csv: bool, **options: Any,
) -> None:  # fmt: skip
    """Fit coefficients of restitution and ratios to measured velocities.

    FILE is a table of shots; `cradle template` prints one to fill in.

    \b
    Examples:
      cradle fit shots.csv
      cradle fit shots.csv --mass-unit g --restitution AC=0.31:0.01
      cradle fit shots.csv --predict ABACA --speed 1.2
      cradle fit shots.csv --json --plot fit.png
    """
    from cradle.fit import ratio, read_shots, restitution

    shots = read_shots(file, **options)
    fits = []
    values: dict[str, tuple[float, float]] = {}
    if any(len(one.types) == 2 for one in shots.sets):
        fits.append(restitution(shots))
        values.update(fits[0].values())
    values.update(
        {name: (pair[0], pair[1] if len(pair) > 1 else 0.0) for name, pair in map(_named, given)}
    )
    if any(len(one.types) > 2 for one in shots.sets):
        fixed = {name: pair[0] for name, pair in map(_named, known)}
        fits.append(ratio(shots, values, known=fixed))
    momentum, count = shots.momentum_check()
    rows = [row for one in fits for row in one.rows()]
    extra = {
        "chi_square": [one.chi_square for one in fits],
        "degrees_of_freedom": [one.degrees_of_freedom for one in fits],
        "momentum_chi_square": momentum,
        "shots": count,
    }
    poor = {True: "", False: " (a poor fit: the errors do not explain the differences)"}
    notes = [
        f"fit: chi-square {one.chi_square:.1f} of {one.degrees_of_freedom}"
        f"{poor[one.probability > 1e-3]}"
        for one in fits
    ]
    notes.append(f"momentum: chi-square {momentum:.1f} of {count} shots")
    if predict is not None:
        predicted = fits[-1].predict(predict, speed)
        extra["prediction"] = predicted.rows()
        notes += ["", f"{predict} at {speed:g} m/s:", text(predicted.rows())]
    if plot is not None:
        plot_fits(fits, plot)
    show(rows, extra, "\n".join(notes), as_json, as_csv)


def _named(given: str) -> tuple[str, list[float]]:
    """Read NAME=NUMBER or NAME=NUMBER:ERROR."""
    name, _, numbers = given.partition("=")
    try:
        return name, [float(part) for part in numbers.split(":")]
    except ValueError:
        raise click.UsageError(f"{given!r}: write NAME=NUMBER or NAME=NUMBER:ERROR") from None


@main.command()
def template() -> None:
    """Print a table of shots to fill in.

    \b
    Examples:
      cradle template
    """
    from cradle.tables import data_folder

    click.echo((data_folder() / "shots_template.csv").read_text(encoding="utf-8"), nl=False)


@main.command()
@chain_options
@click.option("--output", "-o", required=True, type=click.Path(dir_okay=False),
              help="File to draw to: .png, .svg or .pdf.")  # fmt: skip
def plot(output: str, **options: Any) -> None:
    """Draw the velocities of all balls through an impact.

    \b
    Examples:
      cradle plot ABACA --output impact.png
      cradle plot --masses 1,1,1 --ratio 0.15 --output impact.svg
    """
    import matplotlib

    matplotlib.use("Agg")
    from cradle import collide, figures

    given = described(**options)
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.3), layout="constrained")
    figures.velocities(collide(given.chain, given.model), axes)
    figure.savefig(output)
    plt.close(figure)
    click.echo(f"drawn to {output}\n{given.note}")


@main.command()
@chain_options
@click.option("--pull", default=0.05, help="How far the first ball is pulled aside, m along its "
              "arc, at most a quarter of a circle [0.05].")  # fmt: skip
@click.option("--length", default=0.3, help="Of the pendulums, m [0.3].")
@click.option("--seconds", default=2.0, help="How long it swings [2].")
@click.option("--steps", default=20, help="How many rows to print [20].")
@_format_options
def swing(
    pull: float, length: float, seconds: float, steps: int, as_json: bool, as_csv: bool,
    **options: Any,
) -> None:  # fmt: skip
    """Positions of a swinging cradle, impact after impact.

    The first ball is pulled aside and let go; --speed and --velocities do not matter.

    \b
    Examples:
      cradle swing ABACA --pull 0.05 --seconds 1
      cradle swing --masses 1,1,1,1,1 --csv
    """
    from cradle.advice.recommendation import made
    from cradle.chain import Chain
    from cradle.checks import one_number, whole_number
    from cradle.pendulums import Pendulums
    from cradle.swinging import swing as swing_freely

    given = described(**options)
    chain, hanging = given.chain, Pendulums(length=length)
    far = float(hanging.reach(1)[0])
    rule = f"must be above 0 and at most a quarter of a circle of that --length, {far:.4g} m"
    one_number("--pull", pull, rule, 0.0, far, open_low=True)
    one_number("--seconds", seconds, "must be above 0", 0.0, open_low=True)
    whole_number("--steps", steps)
    still = [0.0] * len(chain)
    run = swing_freely(
        Chain(chain.masses, still, chain.restitution), given.model, [-pull, *still[1:]],
        [seconds * k / steps for k in range(steps + 1)],
        pendulums=hanging,
    )  # fmt: skip
    rows = [
        {"time": float(time), **{f"ball {k + 1}": float(x) + 0.0 for k, x in enumerate(places)}}
        for time, places in zip(run.times, run.positions, strict=True)
    ]
    impacts = [
        {"time": float(one.time), "before": one.before.tolist(), "after": one.after.tolist()}
        for one in run.impacts
    ]
    # How fast the first ball strikes follows from the pull.
    told = given._replace(assumed=tuple(one for one in given.assumed if "strikes" not in one))
    extra = {"model": made(given.model), "assumed": told.assumed, "impacts": impacts}
    note = f"impacts: {len(impacts)}; positions in m, times in s\n{told.note}"
    show(rows, extra, note, as_json, as_csv)


main.add_command(film)
main.add_command(recommend)


@main.command(name="warm-up")
def warm_up() -> None:
    """Compile the event loop now, so that long work starts at once later.

    Small work is never compiled, and need not wait for this.

    \b
    Examples:
      cradle warm-up
    """
    from cradle import drive, runtime

    there, begun = runtime.on_disk(), time.perf_counter()
    drive.warm_up()
    seconds = time.perf_counter() - begun
    if not runtime.loaded():
        click.echo(
            f"not compiled: numba is missing or switched off, or {runtime.VARIABLE}=plain is set; "
            "the event loop runs plain"
        )
    elif there:
        click.echo(f"compiled already; loaded in {seconds:.1f} s")
    elif runtime.on_disk():
        click.echo(f"compiled in {seconds:.0f} s, once on this machine")
    else:
        click.echo(f"compiled in {seconds:.0f} s for this process alone: no folder can be written")


def run(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit; wrong input ends in one line on standard error.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the command's name; that of this process if left out.

    Raises
    ------
    SystemExit
        Always, with the exit code.
    """
    from cradle.trace import ImpactNotCertified, ImpactNotFinished

    try:
        main(arguments, prog_name="cradle")
    except (ValueError, OSError, ImpactNotFinished, ImpactNotCertified) as error:
        message = str(error)
        for python, option in _OPTIONS.items():
            message = message.replace(python, option)
        click.echo(f"cradle: {message}", err=True)
        sys.exit(1)
