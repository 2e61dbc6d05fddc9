"""The command line: `cradle solve`, `film`, `fit` ...; also `python -m cradle`.

Answers go to standard output, errors to standard error.  Exit codes: 0 for an answer, 1 for input
that is wrong or an impact that did not finish, 2 for a command that was not understood.
"""

import re
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import click

import cradle
from cradle import collide
from cradle.advice.choice import made
from cradle.command.console import format_options, plotted, save, show
from cradle.command.describe import chain_options, described, one_or_all
from cradle.command.film import film, fit_swing
from cradle.command.fit import fit, template
from cradle.command.swing import swing
from cradle.runtime import compile as runtime
from cradle.runtime import job as drive

# What errors say of arguments, as options; a row of values counts from 1, like the tables.
_ROW = r"\b(masses|velocities|restitution|ratio|backward|stiffness|gaps|damping)"
_SHOOT = r"shoot these two balls alone, or give --restitution \1=E:ERROR"
_OPTIONS: dict[str, str | Callable[[re.Match[str]], str]] = {
    r"^No module named '(?!cradle)(\w+).*": r"needs \1, which is not installed: pip install \1",
    r"excess='saturate'": "--saturate",
    r"(mass|velocity)_unit='(\S+)'": r"--\1-unit \2",
    r"\bstiffness=": "--stiffness ",
    r"divide time_scale by 1000": "say --slower 1000",
    r"see time_scale": "see --slower",
    r"say the unit of the positions": "say --position-unit cm or mm, or px and --scale",
    r"\b(sigma|known)=": r"--\1",
    r"(?<!column )\b(wanted|accuracy|impacts|length|sigma|speed|window|reading) = ": r"--\1 ",
    r"^path = ": "--output ",
    r"\btypes = ": "--predict ",
    r"give known\['period'\]": "give --known period=",
    r"free or known = ": "--known ",
    r"restitution has no '(.+?)', which set (.+) needs; it has (.*)": (
        rf"set \2 needs the restitution of \1: {_SHOOT} (there are: \3)"
    ),
    r"the coefficient of restitution of (\S+) is not known": rf"\g<0>: {_SHOOT}",
    r"the ratio of (\S+) is not known": r"\g<0> (--known \1=RATIO)",
    r"(restitution|known)\['(.+?)'\](?:\[\d\])? = ": r"--\1 \2: ",
    r"\b(?:for|(back))ward\[\d+\] = (\S+); at ball (\d+), counted from 0, it": lambda found: (
        f"the {'backward ' * bool(found[1])}ratio of ball {int(found[3]) + 1} is {found[2]}; it"
    ),
    r"\bforward\b(?=\[| = | has)": "ratio",
    _ROW + r"\[(\d+)\] = ": lambda found: f"--{found[1]}, value {int(found[2]) + 1}: ",
    _ROW + r" has shape \((\d+),\);[^:]*: ": r"--\1, \2 given: ",
    _ROW + "(?= = | has)": r"--\1",
    r"positions\[(\d+)\] = ": lambda found: f"ball {int(found[1]) + 1} at ",
    r"\bsequence = ": "SEQUENCE = ",
    r"sequence\[(\d+)\] = ": lambda found: f"SEQUENCE, ball {int(found[1]) + 1}: ",
}


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="cradle-companion", prog_name="cradle")
@click.pass_context
def main(context: click.Context) -> None:
    """Impacts in chains of balls: Newton's cradle by the Impulse Correlation Ratio.

    \b
    For a start:
      cradle solve 5
      cradle swing 5 -o toy.gif
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@main.command(params=chain_options())
@click.option("--plot", type=click.Path(dir_okay=False), callback=plotted,
              help="Draw the velocities to a file: .png, .svg or .pdf.")  # fmt: skip
@format_options
def solve(plot: str | None, as_json: bool, as_csv: bool, **options: Any) -> None:
    """Velocities after an impact; balls and contacts count from 1, the left.

    SEQUENCE names the paper's balls, first ball first, such as ABACA, or says how many equal balls
    there are, such as 5; or give --masses.

    \b
    Examples:
      cradle solve 5
      cradle solve ABACA --speed 1
      cradle solve ABCCA --saturate --json
      cradle solve --masses 45,53,53 --unit g --restitution 0.53,0.36 --ratio 0.104
      cradle solve --masses 1,1,1 --velocities 1,0,-1 --model sequential --csv
      cradle solve --masses 1,1,1 --ratio 0.15 --plot impact.svg
      cradle solve 5 --unit g --velocities 1,1,0,0,0 --stiffness 1e10 --gaps 2e-5,0,0,2e-5
    """
    given = described(**options)
    chain = given.chain
    drawn = plot or not isinstance(given.model, cradle.ImpulseCorrelation)
    trace = collide(given.taken, given.model, record=None if drawn else False, progress=True)
    if plot:
        save(plot, (7, 4.3), lambda figure: trace.plot(figure.subplots()))
    rows = [
        {"ball": k + 1, "type": given.letters[k], "mass": float(chain.masses[k]),
         "before": float(chain.velocities[k]), "after": float(trace.velocities[k]) + 0.0}
        for k in range(len(chain))
    ]  # fmt: skip
    lost = float(trace.energy_loss / (chain.kinetic_energy or 1.0))  # nothing, of balls at rest
    # Those of springs are counted along the way, which of a long row fills the memory.
    few = len(chain) <= 20 or not isinstance(given.model, cradle.SpringChain)
    collisions = trace.collisions.tolist() if few else None
    held = [contact + 1 for contact in trace.saturated]
    extra = {
        "model": made(given.model), "assumed": given.assumed, "energy_lost": lost,
        "collisions": collisions, "collapsed": trace.collapsed, "held_contacts": held,
    }  # fmt: skip
    counts, contacts = (", ".join(map(str, counted or [])) for counted in (collisions, held))
    if collisions and len(collisions) > 20:  # they would fill the screen; --json has them
        counts = f"{min(collisions)} to {max(collisions)}"
    told = {
        "no balls approach: no impact": not (chain.closing_speeds > 0.0).any(),
        f"energy lost: {100 * lost:z.2f} %{f'; collisions of the contacts: {counts}' * few}": True,
        f"held closed at their largest ratio: contact {contacts} (--saturate)": held,
        "an infinite sequence of impacts was taken to its limit": trace.collapsed,
        given.note: True,
    }
    show(rows, extra, "\n".join(words for words in told if told[words]), as_json, as_csv)


@main.command(params=chain_options("model", "gaps"))
@click.option("--wanted", multiple=True, default=["velocities"], help="velocities, impulses, path, "
              "forces, times, fastest ball; with commas between [velocities].")  # fmt: skip
@click.option("--accuracy", default=1e-6, help="Largest numerical error, as a part of the closing "
              "speed [1e-6].")  # fmt: skip
@click.option("--impacts", default=1, help="How many such impacts [1].")
def recommend(
    wanted: Sequence[str], stiffness: list[float] | None, accuracy: float, impacts: int,
    **options: Any,
) -> None:  # fmt: skip
    """Which impact law to use, with its measured error and time.

    \b
    Examples:
      cradle recommend 5 --restitution 0.9 --accuracy 1e-3
      cradle recommend ABACA --impacts 1000
      cradle recommend --masses 1,2,1 --wanted "fastest ball"
    """
    given = described(**options)
    wishes = [name.strip() for names in wanted for name in names.split(",")]
    more = len(given.chain) > 2  # two balls have no ratio
    law = given.model if more and isinstance(given.model, cradle.ImpulseCorrelation) else None
    spheres = more and law is None and stiffness is None
    spheres &= {"velocities", "impulses", "path"} >= {*wishes}
    advice = cradle.recommend(
        given.chain, wishes, accuracy=accuracy, impacts=impacts, ratios=law,
        stiffness=1.0 if spheres else one_or_all(stiffness),
    )  # fmt: skip
    click.echo(repr(advice))
    assumed = [words for words in given.assumed if "--model" not in words]
    if assumed := assumed + ["equal spheres (--stiffness, --ratio)"] * spheres:
        click.echo(f"  {'assumed:':<17}{'; '.join(assumed)}")


for verb in (film, fit, fit_swing, swing, template):
    main.add_command(verb)


@main.command(name="warm-up")
def warm_up() -> None:
    """Compile the solvers now, by ratios and of spheres, so that long work starts at once later.

    Small work is never compiled, and need not wait for this.
    """
    begun = time.perf_counter()
    drive.warm_up()
    told = f"compiled, and loaded in {time.perf_counter() - begun:.1f} s"
    if not runtime.loaded():
        told = f"not compiled: numba is missing or switched off, or {runtime.VARIABLE}=plain is set"
    click.echo(told)


def run(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit; wrong input ends in one line on standard error."""
    try:
        main(arguments, prog_name="cradle")
    except (ValueError, OSError, ImportError, RuntimeError) as error:
        message = str(error)
        for python, option in _OPTIONS.items():
            message = re.sub(python, option, message)
        click.echo(f"cradle: {message}", err=True)
        sys.exit(1)
