"""`cradle film`: from marks in films to rows of the table of shots."""

import csv
import sys
import warnings
from pathlib import Path
from typing import Any

import click

from cradle.command.describe import UNITS, numbers_of, pendulum_length, swing_options

_SIZES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


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
@click.option("--position-unit", type=click.Choice([*_SIZES, "px"]),
              help="Of positions, where the file does not say it [m].")  # fmt: skip
@click.option("--scale", type=float, help="Pixels in a metre.")
@click.option("--window", type=float, help="Time used before and after, s [the longest that fits].")
@click.option("--slower", default=1.0, help="8 if 240 pictures a second play at 30 [1].")
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
    from cradle.input.values import ABOVE_ZERO, checked_masses, one_number

    length, window = pendulum_length(length, period), options["window"]
    given = {"length": length, "window": window, "--slower": slower, "--scale": scale}
    for option, value in given.items():
        if value is not None:
            one_number(option, value, *ABOVE_ZERO)
    if shot is not None and len(files) > 1:
        raise click.UsageError("--shot names one film; several have the names of their files")
    if (length is None) != level:
        raise click.UsageError("give --length or --period of the pendulums, or --level: one")
    if (position_unit == "px") != (scale is not None):
        raise click.UsageError("--position-unit px and --scale, pixels in a metre, go together")
    size = _SIZES[position_unit or "m"] if scale is None else 1.0 / scale
    types = parameter_key(name)
    kilograms = checked_masses([UNITS[unit or "kg"] * mass for mass in masses]).tolist()
    writer, wrong = csv.writer(sys.stdout, lineterminator="\n"), []
    for file in files:
        try:
            told, one = _velocities(file, types, masses, length, 1.0 / slower, size, **options)
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
    time_scale: float, size: float, window: float | None,
) -> tuple[str, Any]:  # fmt: skip
    """Return what was warned of, and the velocities in one film, of balls of these types."""
    import numpy as np

    from cradle.fit import read_tracker, velocities_from_tracks

    tracks = read_tracker(file, time_scale=time_scale, unit=size)
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
