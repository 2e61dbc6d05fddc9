"""`cradle film`: from marks in films to rows of the table of shots; `fit-swing`: a fit to them."""

import csv
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

import cradle
from cradle.command.console import format_options, plotted, save, show
from cradle.command.describe import UNITS, numbers_of, one_or_all, pendulum_length, swing_options
from cradle.command.fit import named_number
from cradle.input.values import ABOVE_ZERO, checked_masses, one_number, whole_number

_SIZES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


def _track_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add what is to be known of a tracker's file; see `_units`."""
    slower = click.option("--slower", default=1.0,
                          help="8 if 240 pictures a second play at 30 [1].")  # fmt: skip
    scale = click.option("--scale", type=float, help="Pixels in a metre.")
    unit = click.option("--position-unit", type=click.Choice([*_SIZES, "px"]),
                        help="Of positions, where the file does not say it [m].")  # fmt: skip
    return unit(scale(slower(command)))


def _units(position_unit: str | None, scale: float | None, slower: float) -> dict[str, float]:
    """Return these options as `read_tracker` takes them."""
    if (position_unit == "px") != (scale is not None):
        raise click.UsageError("--position-unit px and --scale, pixels in a metre, go together")
    size = one_number("--scale", 1.0 if scale is None else scale, *ABOVE_ZERO)
    slower = one_number("--slower", slower, *ABOVE_ZERO)
    return {"unit": _SIZES.get(position_unit or "m", 1.0) / size, "time_scale": 1.0 / slower}


@click.command()
@click.argument("files", nargs=-1, required=True, type=_FILE)
@click.option("--set", "letters", required=True, help="Types of the balls, left to right: BAC.")
@click.option("--name", help="Name of the set, such as '2 lifted' [its letters].")
@click.option("--shot", help="Name of the shot [that of the file].")
@click.option("--masses", required=True, callback=numbers_of,
              help="Masses, left to right: 53,45,53.")  # fmt: skip
@click.option("--unit", type=click.Choice(list(UNITS)), help="Of masses [kg].")
@swing_options("or --period, or --level")
@click.option("--level", is_flag=True, help="The balls do not hang: they roll on a level track.")
@click.option("--striker", multiple=True, type=int, help="Each ball lifted, if there are several: "
              "--striker 1 --striker 2 [the one that moves most].")  # fmt: skip
@_track_options
@click.option("--window", type=float, help="Time used before and after, s [the longest that fits].")
@click.option("--header", is_flag=True, help="Print the names of the columns too.")
def film(
    files: tuple[Path, ...], letters: str, name: str | None, shot: str | None, masses: list[float],
    unit: str | None, header: bool, length: float | None, period: float | None, level: bool,
    window: float | None, striker: Sequence[int], **options: Any,
) -> None:  # fmt: skip
    """Velocities from the marks in films, a film a shot.

    FILES are exported by Tracker, Kinovea, Logger Pro or Capstone, one track a ball, left to right;
    tracks named by types are in the order of --set.  One ball strikes the others at rest, or some
    together (--striker), from either end.  Prints rows for the table that `cradle fit` reads; what
    was used of each film, and what is wrong with one, goes to standard error.

    \b
    Examples:
      cradle film film.txt --set BAC --masses 53,45,53 --unit g --length 0.3 --header
      cradle film film.txt --set BAC --masses 0.053,0.045,0.053 --period 2.2 --slower 2
    """
    from cradle.fit.parameters import parameter_key
    from cradle.fit.shots import COLUMNS

    length, units = pendulum_length(length, period), _units(**options)
    for option, value in {"length": length, "window": window}.items():
        if value is not None:
            one_number(option, value, *ABOVE_ZERO)
    if shot is not None and len(files) > 1:
        raise click.UsageError("--shot names one film; several have the names of their files")
    if (length is None) != level:
        raise click.UsageError("give --length or --period of the pendulums, or --level: one")
    types = parameter_key(letters)
    kilograms = checked_masses([UNITS[unit or "kg"] * mass for mass in masses]).tolist()
    writer, wrong = csv.writer(sys.stdout, lineterminator="\n"), []
    for file in files:
        try:
            told, one = _velocities(file, types, masses, units, length, window, striker)
        except (ValueError, OSError) as reason:  # the other films may be right
            wrong.append(f"{file.name}: " * (not str(reason).startswith(file.name)) + str(reason))
            continue
        if header:
            writer.writerow(COLUMNS)
            header = False
        measured = one.before, one.after, one.sigma, one.sigma_before
        for k, (kind, *numbers) in enumerate(zip(types, kilograms, *measured, strict=True), 1):
            writer.writerow(
                [name or letters, shot or file.stem, k, kind, *(f"{x:.6g}" for x in numbers)]
            )
        lifted = [str(k + 1) for k in one.before.nonzero()[0]]
        who = f"balls {' and '.join(lifted)} strike" if lifted[1:] else f"ball {lifted[0]} strikes"
        when = f"{who} at {one.time:.4g} s, marks within {one.window:.3g} s"
        how = f"marks scatter by {one.scatter:.2g} m; chance of such a fit {one.probability:.2g}"
        click.echo(f"{file.name}: {when}, {how}{told}", err=True)
    if unit is None and len(wrong) < len(files):
        click.echo("assumed: masses in kg (--unit)", err=True)
    if wrong:
        raise ValueError("\ncradle: ".join(wrong))


def _velocities(
    file: Path, types: tuple[str, ...], masses: list[float], units: dict[str, float],
    length: float | None, window: float | None, striker: Sequence[int],
) -> tuple[str, Any]:  # fmt: skip
    """Return what was warned of, and the velocities in one film, of balls of these types."""
    from cradle.fit import read_tracker, velocities_from_tracks

    tracks = read_tracker(file, **units)
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
    n = len(tracks)
    movers = {whole_number("--striker", k, f"from 1 to {n}", 1, n) - 1 for k in striker}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = velocities_from_tracks(
            tracks, length=length, window=window, striker=sorted(movers) or None
        )
    return "".join(f"; {one.message}" for one in told), found


@click.command(name="fit-swing")
@click.argument("file", type=_FILE)
@click.option("--masses", callback=numbers_of, help="Masses, left to right: 45,53,53 [equal].")
@click.option("--ratio", callback=numbers_of, help="One, or one per inner ball: the balls collide "
              "by ratios [one pair after the other].")  # fmt: skip
@click.option("--known", multiple=True, metavar="NAME=VALUE", help="What is not fitted: "
              "period=0.8, damping=0, restitution=1 or gaps=0.0001.")  # fmt: skip
@click.option("--reading", type=float, help="Error of a mark, m [found from the residuals].")
@_track_options
@click.option("--plot", type=click.Path(dir_okay=False), callback=plotted,
              help="Draw film, fit and residuals to a file.")  # fmt: skip
@format_options
def fit_swing(
    file: Path, masses: list[float] | None, ratio: list[float] | None, known: Sequence[str],
    reading: float | None, plot: str | None, as_json: bool, as_csv: bool, **options: Any,
) -> None:  # fmt: skip
    """Period, damping, restitution and gap of a cradle, from a film of its swing.

    FILE is exported by Tracker, Kinovea, Logger Pro or Capstone, one track a ball, left to right;
    it begins when the balls are on their way.  The intervals are those that hold 95 %.

    \b
    Examples:
      cradle fit-swing swing.txt
      cradle fit-swing swing.txt --masses 45,53,45 --ratio 0.1 --known damping=0 --plot swing.png
    """
    from cradle import fit as fits

    numbers = {name: value for name, (value, _) in map(named_number, known)}
    if len(numbers) < len(known) or ":" in "".join(known):
        raise click.UsageError(f"--known {' '.join(known)}: write NAME=VALUE, once, with no error")
    law = cradle.ImpulseCorrelation(one_or_all(ratio or [0.0]), excess="saturate")
    times, places = fits.frames(fits.read_tracker(file, **_units(**options)))
    found = fits.fit_swing(times, places, law, reading=reading, known=numbers, masses=masses)
    if plot is not None:
        save(plot, (5.6, 6), lambda figure: found.plot(figure.subplots(2, sharex=True)))
    assumed = ["equal gaps", *["one pair collides after the other (--ratio)"] * (ratio is None)]
    if not (as_json or as_csv):
        click.echo(f"{found.summary()}\nassumed: {'; '.join(assumed)}")
        return
    rows = [one.row() for one in found.estimates.values()]
    more = ("reading", "chi_square", "degrees_of_freedom", "correlation", "poor", "widened")
    extra = {name: getattr(found, name) for name in more} | {"assumed": assumed}
    show(rows, extra, "", as_json, as_csv)
