"""`cradle film`: from an export of the video tool Tracker to rows of the table of shots."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import click

from cradle.command.describe import UNITS, numbers_of


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--set", "name", required=True, help="Types of the balls, left to right: BAC.")
@click.option("--shot", default="1", help="Name of the shot [1].")
@click.option("--masses", required=True, callback=numbers_of,
              help="Masses, left to right: 53,45,53.")  # fmt: skip
@click.option("--unit", type=click.Choice(list(UNITS)), default="kg", help="Of masses.")
@click.option("--length", type=float, help="Of the pendulums, m; left out: a level track.")
@click.option("--window", default=0.05, help="Time used before and after, s [0.05].")
@click.option("--slower", default=1.0, help="8 if 240 pictures a second play at 30 [1].")
@click.option("--header", is_flag=True, help="Print the names of the columns too.")
def film(
    file: Path, name: str, shot: str, masses: list[float], unit: str, length: float | None,
    window: float, slower: float, header: bool,
) -> None:  # fmt: skip
    """Velocities from the marks in a film.

    FILE is exported by the video tool Tracker, one track a ball, left to right; tracks named by
    types are in the order of --set.  The first ball strikes the others at rest.  Prints the rows of
    one shot for the table that `cradle fit` reads.

    \b
    Examples:
      cradle film film.txt --set BAC --masses 53,45,53 --unit g --length 0.3 --header
      cradle film film.txt --set BAC --masses 0.053,0.045,0.053 --shot 2 --slower 2
    """
    from cradle.fit import read_tracker, velocities_from_tracks
    from cradle.fit.parameters import parameter_key
    from cradle.fit.reading import COLUMNS, OPTIONAL
    from cradle.input.values import one_number

    one_number("--slower", slower, "must be above 0", 0.0, open_low=True)
    tracks = read_tracker(file, time_scale=1.0 / slower)
    types = parameter_key(name)
    if not len(types) == len(masses) == len(tracks):
        raise ValueError(
            f"{file.name} has {len(tracks)} tracks, --set {len(types)} types and --masses "
            f"{len(masses)} masses; must be as many"
        )
    for place, (kind, track) in enumerate(zip(types, tracks, strict=True), 1):
        if track in types and track != kind:
            raise ValueError(
                f"{file.name}: track {place} is named {track}, --set {name} has {kind} there; both "
                "go from left to right"
            )
    found = velocities_from_tracks(tracks, length=length, window=window)
    writer = csv.writer(sys.stdout, lineterminator="\n")
    if header:
        writer.writerow([*COLUMNS, *OPTIONAL])
    weights = [UNITS[unit] * mass for mass in masses]
    for k, (kind, mass) in enumerate(zip(types, weights, strict=True)):
        numbers = (mass, found.before[k], found.after[k], found.sigma[k], found.sigma_before[k])
        writer.writerow([name, shot, k + 1, kind, *(f"{x:.6g}" for x in numbers)])
