"""`cradle film`: from marks in films to rows of the table of shots; `cradle fit-swing`: a swing."""

import csv
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from cradle.command.console import format_options, plotted, show
from cradle.command.describe import UNITS, numbers_of, one_or_all, pendulum_length, swing_options
from cradle.input.values import ABOVE_ZERO, one_number

_SIZES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "px": 1.0}


def _marks(command: Callable[..., None]) -> Callable[..., None]:
    """Add what says how a program has written marks; see `_read_as`."""
    unit = click.option("--position-unit", type=click.Choice(list(_SIZES)),
                        help="Of positions, where the file does not say it [m].")  # fmt: skip
    scale = click.option("--scale", type=float, help="Pixels in a metre.")
    slower = click.option("--slower", default=1.0,
                          help="8 if 240 pictures a second play at 30 [1].")  # fmt: skip
    return unit(scale(slower(command)))


def _read_as(position_unit: str | None, scale: float | None, slower: float) -> dict[str, float]:
    """Return what `read_tracker` is told of a file."""
    one_number("--slower", slower, *ABOVE_ZERO)
    pixels = one_number("--scale", 1.0 if scale is None else scale, *ABOVE_ZERO)
    if (position_unit == "px") != (scale is not None):
        raise click.UsageError("--position-unit px and --scale, pixels in a metre, go together")
    return {"time_scale": 1.0 / slower, "unit": _SIZES[position_unit or "m"] / pixels}


@click.command()
@click.argument("files", nargs=-1, required=True,
                type=click.Path(exists=True, dir_okay=False, path_type=Path))  # fmt: skip
@click.option("--set", "name", required=True, help="Types of the balls, left to right: BAC.")
@click.option("--shot", help="Name of the shot [that of the file].")
@click.option("--masses", required=True, callback=numbers_of,
              help="Masses, left to right: 53,45,53.")  # fmt: skip
@click.option("--unit", type=click.Choice(list(UNITS)), help="Of masses [kg].")
@swing_options("or --period, or --level")
@click.option("--level", is_flag=True, help="The balls do not hang: they roll on a level track.")
@_marks
@click.option("--window", type=float, help="Time used before and after, s [the longest that fits].")
@click.option("--header", is_flag=True, help="Print the names of the columns too.")
def film(
    files: tuple[Path, ...], name: str, shot: str | None, masses: list[float], unit: str | None,
    header: bool, length: float | None, period: float | None, level: bool,
    position_unit: str | None, scale: float | None, slower: float, **options: Any,
) -> None:  # fmt: skip
    """Velocities from the marks in films, a film a shot.

    FILES are exported by Tracker, Kinovea, Logger Pro or Capstone, one track a ball, left to right;
    tracks named by types are in the order of --set.  One ball strikes the others at rest, from
    either end.  Prints rows for the table that `cradle fit` reads; what was used of each film, and
    what is wrong with one, goes to standard error.

    \b
    Examples:
      cradle film film.txt --set BAC --masses 53,45,53 --unit g --length 0.3 --header
      cradle film film.txt --set BAC --masses 0.053,0.045,0.053 --period 2.2 --slower 2
    """
    from cradle.fit.parameters import parameter_key
    from cradle.fit.shots import COLUMNS
    from cradle.input.values import checked_masses

    length, window = pendulum_length(length, period), options["window"]
    for option, value in {"length": length, "window": window}.items():
        if value is not None:
            one_number(option, value, *ABOVE_ZERO)
    read = _read_as(position_unit, scale, slower)
    if shot is not None and len(files) > 1:
        raise click.UsageError("--shot names one film; several have the names of their files")
    if (length is None) != level:
        raise click.UsageError("give --length or --period of the pendulums, or --level: one")
    types = parameter_key(name)
    kilograms = checked_masses([UNITS[unit or "kg"] * mass for mass in masses]).tolist()
    writer, wrong = csv.writer(sys.stdout, lineterminator="\n"), []
    for file in files:
        try:
            told, one = _velocities(file, types, masses, length, read, **options)
        except (ValueError, OSError) as reason:  # the other films may be right
            named = str(reason).startswith(file.name)
            wrong.append(str(reason) if named else f"{file.name}: {reason}")
            continue
        if header:
            writer.writerow(COLUMNS)
            header = False
        measured = one.before, one.after, one.sigma, one.sigma_before
        for k, (kind, *numbers) in enumerate(zip(types, kilograms, *measured, strict=True), 1):
            writer.writerow([name, shot or file.stem, k, kind, *(f"{x:.6g}" for x in numbers)])
        striker = max(range(len(types)), key=lambda k: abs(one.before[k])) + 1
        when = f"ball {striker} strikes at {one.time:.4g} s, marks within {one.window:.3g} s"
        how = f"marks scatter by {one.scatter:.2g} m; chance of such a fit {one.probability:.2g}"
        click.echo(f"{file.name}: {when}, {how}{told}", err=True)
    if unit is None and len(wrong) < len(files):
        click.echo("assumed: masses in kg (--unit)", err=True)
    if wrong:
        raise ValueError("\ncradle: ".join(wrong))


def _velocities(
    file: Path, types: tuple[str, ...], masses: list[float], length: float | None,
    read: dict[str, float], window: float | None,
) -> tuple[str, Any]:  # fmt: skip
    """Return what was warned of, and the velocities in one film, of balls of these types."""
    import numpy as np

    from cradle.fit import read_tracker, velocities_from_tracks

    tracks = read_tracker(file, **read)
    if not len(types) == len(masses) == len(tracks):
        there = f"{file.name} has {len(tracks)} tracks, --set {len(types)} types and --masses"
        raise ValueError(f"{there} {len(masses)} masses; must be as many")
    for place, (kind, track) in enumerate(zip(types, tracks, strict=True), 1):
        if track in types and track != kind:
            there = f"track {place} is named {track}, --set {''.join(types)} has {kind} there"
            raise ValueError(f"{there}; both go from left to right")
    fastest = max(float(np.ptp(x) / (np.ptp(t) or 1.0)) for t, x in tracks.values())
    if length is None and fastest > 20.0:  # a pendulum's length tells by itself
        raise ValueError(f"{fastest:.3g} m/s is unlikely; say the unit of the positions")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = velocities_from_tracks(tracks, length=length, window=window)
    return "".join(f"; {one.message}" for one in told), found


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@_marks
@click.option("--masses", callback=numbers_of, help="Masses, left to right: 53,45,53 [equal].")
@click.option("--ratio", callback=numbers_of, help="One, or one per inner ball [0: in pairs].")
@click.option("--known", multiple=True, metavar="NAME=VALUE",
              help="Not to be fitted: period, damping, restitution or gaps.")  # fmt: skip
@click.option("--reading", type=float, help="Standard error of a place, m [as the fit leaves it].")
@click.option("--plot", type=click.Path(dir_okay=False), callback=plotted,
              help="Draw film and fit to a file.")  # fmt: skip
@format_options
def fit_swing(
    file: Path, masses: list[float] | None, ratio: list[float] | None, known: Sequence[str],
    reading: float | None, plot: str | None, as_json: bool, as_csv: bool, **marks: Any,
) -> None:  # fmt: skip
    """Period, damping, restitution and gap of a cradle, from marks of some seconds.

    FILE is exported by Tracker, Kinovea, Logger Pro or Capstone, one track a ball, left to right.
    It begins soon after some balls were let go, while the others rest.

    \b
    Examples:
      cradle fit-swing swing.txt
      cradle fit-swing swing.txt --slower 8 --known damping=0 --plot fit.png
    """
    from cradle import ImpulseCorrelation, fit
    from cradle.command.fit import named

    tracks = fit.read_tracker(file, **_read_as(**marks))
    law = ImpulseCorrelation(one_or_all(ratio or [0.0]))
    given = {name: value for name, (value, _) in map(named, known)}
    film = fit.frames(tracks)
    found = fit.fit_swing(*film, law, reading=reading, masses=masses, known=given)
    if plot is not None:
        found.plot()[0].get_figure().savefig(plot, format=Path(plot).suffix[1:] or "png")
    if not (as_json or as_csv):
        click.echo(found.summary())
        return
    rows = [{"name": name, "value": found.values[name], "low": low, "high": high}
            for name, (low, high) in found.intervals.items()]  # fmt: skip
    kept = "reading", "chi_square", "degrees_of_freedom", "correlation", "poor"
    show(rows, {name: getattr(found, name) for name in kept}, "", as_json, as_csv)
