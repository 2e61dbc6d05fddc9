"""`cradle fit`: restitution and ratios from a table of shots; `cradle template`: such a table."""

import sys
from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import Any

import click

from cradle.command.console import format_options, plot_fits, plotted, show, text
from cradle.input.values import ABOVE_ZERO, one_number
from cradle.tables import data_folder

# What a command needs is imported in the command: the first answer comes within a second.


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, allow_dash=True,
                                        path_type=Path))  # fmt: skip
@click.option("--mass-unit", type=click.Choice(["kg", "g"]), help="Unit of the column mass [kg].")
@click.option("--velocity-unit", type=click.Choice(["m/s", "cm/s", "mm/s"]),
              help="Unit of before, after and sigma [m/s].")  # fmt: skip
@click.option("--sigma", type=float, help="Error of all velocities, for a file without it.")
@click.option("--without", multiple=True, metavar="SET[,SET...]",
              help="Sets of the file that are not to be fitted.")  # fmt: skip
@click.option("--restitution", "given", multiple=True, metavar="PAIR=E[:ERROR]",
              help="For pairs that no fitted set shoots alone: AB=0.53:0.01.")  # fmt: skip
@click.option("--known", multiple=True, metavar="TRIPLET=RATIO",
              help="Ratios not to be fitted, up to their bound.")  # fmt: skip
@click.option("--predict", metavar="SEQUENCE", help="Predict a chain of these balls, beside its "
              "measured mean if the file has shots of it.")  # fmt: skip
@click.option("--speed", type=float, help="Of its first ball, with --predict, m/s [1].")
@click.option("--plot", type=click.Path(dir_okay=False), callback=plotted,
              help="Draw the likelihoods to a file.")  # fmt: skip
@click.option("--summary", is_flag=True, help="Print errors, correlations and residuals instead.")
@format_options
def fit(
    file: Path, without: Sequence[str], predict: str | None, speed: float | None, plot: str | None,
    summary: bool, as_json: bool, as_csv: bool, **options: Any,
) -> None:  # fmt: skip
    """Fit coefficients of restitution and ratios to measured velocities.

    FILE is a table of shots, - one from standard input; `cradle template` prints one to fill in.

    All sets of the file are fitted, chains of four and more balls too: a prediction is checked only
    by shots that --without keeps out of the fit.

    The column intervals is the 95 % confidence set.  If several ranges of values explain the shots
    it has several pieces: 0.10-0.12 or 0.17-0.19.  With --csv this is 0.10..0.12; 0.17..0.19 in one
    cell, with --json the list [[0.10, 0.12], [0.17, 0.19]].  Then: how many minima chi-square has,
    whether the shots tell the value at all, the end of the range if it is one, and the upper end.

    \b
    Examples:
      cradle fit shots.csv
      cradle fit shots.csv --mass-unit g --without AC --restitution AC=0.31:0.01
      cradle fit shots.csv --predict ABACA --speed 1.2
      cradle fit long.csv --without ABACA --predict ABACA
      cradle fit shots.csv --summary
      cradle fit shots.csv --json --plot fit.png
    """
    from cradle.fit import ratio, read_shots, restitution
    from cradle.fit.parameters import parameter_key, ratio_keys, types_in_a_row
    from cradle.fit.result import FOLDED, RESULT_COLUMNS
    from cradle.fit.shots import chance

    if summary and (as_json or as_csv):
        raise click.UsageError("give one of --summary, --json and --csv")
    if predict is not None and as_csv:
        raise click.UsageError("--csv prints the fitted values alone; with --predict give --json")
    if predict is None and speed is not None:
        raise click.UsageError("--speed is that of the chain to --predict; give both")
    striker = 1.0 if speed is None else speed
    if predict is not None:  # what is wrong is said before the fit, not after it
        types_in_a_row(predict)
        one_number("speed", striker, *ABOVE_ZERO)
    given = [named_number(one) for one in options.pop("given")]
    known = [(name, value) for name, (value, _) in map(named_number, options["known"])]
    if wrong := [one for one in options.pop("known") if ":" in one]:
        raise click.UsageError(f"{wrong[0]!r}: write TRIPLET=RATIO; a known ratio has no error")
    shots = read_shots(sys.stdin.buffer if str(file) == "-" else file, **options)
    there = {one.name for one in shots.sets}  # a name may have a comma
    lists = [[part] if part in there else part.split(",") for part in without]
    used = shots.without(*(name.strip() for names in lists for name in names))
    _refuse_unused([name for name, _ in given], [name for name, _ in known], used, predict)
    pairs = [restitution(used)] if any(len(one.types) == 2 for one in used.sets) else []
    values = {**(pairs[0].values() if pairs else {}), **dict(given)}
    free = [ratio_keys(one.types) - {parameter_key(name) for name, _ in known} for one in used.sets]
    if (most := max(map(len, free))) > 4:
        click.echo(f"cradle: {most} ratios are fitted together, which takes minutes; shots of "
                   "fewer balls, or --known, would make it faster", err=True)  # fmt: skip
    last = ratio(used, values, known=dict(known), progress=True)  # it predicts
    fits = [one for one in (*pairs, last) if one.estimates]
    momentum, count = shots.momentum_check()
    extra: dict[str, Any] = {name: [getattr(one, name) for one in fits]
                             for name in ("chi_square", "degrees_of_freedom")}  # fmt: skip
    left = [one.name for one in shots.sets if one not in used.sets]
    extra |= {"momentum_chi_square": momentum, "shots": count, "without": left}
    quality = [_quality(one, "ratios" if one is last else "restitution") for one in fits]
    notes = ["fit: no ratio is fitted; those of --known are taken as they are"]
    notes *= bool(known and not last.estimates)
    whole = " (all of the file)" * bool(left)
    lost = "; masses, velocities or their errors are wrong" * (chance(momentum, count) <= 1e-3)
    notes.append(f"momentum: chi-square {momentum:.1f} of {count} shots{whole}{lost}")
    if predict is not None:
        more, lines = _predicted(last, shots, predict, striker)
        extra, notes = extra | more, notes + lines
    if plot is not None:
        plot_fits(fits, plot)
    if summary:
        click.echo("\n".join([*(one.summary() for one in fits), *notes]))
        return
    folds = [f"{e.name}{FOLDED}" for one in fits for e in one.estimates.values() if e.folded]
    lines = ["intervals: 95 % confidence sets", *folds, *quality, *notes]
    rows = [row for one in fits for row in one.rows()]
    show(rows, extra, "\n".join(lines), as_json, as_csv, RESULT_COLUMNS)


def _quality(found: Any, what: str) -> str:
    """Return how well a fit explains the shots."""
    poor = " (a poor fit: the errors do not explain the differences)"
    told = f"fit of {what}: chi-square {found.chi_square:.1f} of {found.degrees_of_freedom}"
    return told + poor * bool(found.probability <= 1e-3)


def named_number(given: str) -> tuple[str, tuple[float, float]]:
    """Read NAME=NUMBER or NAME=NUMBER:ERROR."""
    name, _, numbers = given.partition("=")
    value, _, error = numbers.partition(":")
    try:
        return name, (float(value), float(error or 0))
    except ValueError:
        raise click.UsageError(f"{given!r}: write NAME=NUMBER or NAME=NUMBER:ERROR") from None


def _refuse_unused(given: list[str], known: list[str], shots: Any, predict: str | None) -> None:
    """Refuse a value that no chain needs (its name may be misspelt), and one that is there."""
    from cradle.fit.parameters import label, pair_keys, parameter_key, ratio_keys

    chains = [one.types for one in shots.sets] + ([parameter_key(predict)] if predict else [])
    there = {("--restitution", pair_keys(one.types)[0]): f"set {one.name} is fitted for it; leave "
             f"one of them out (--without {quote(one.name)})"
             for one in shots.sets if len(one.types) == 2}  # fmt: skip
    values = [("--restitution", "pair", name, tuple(sorted(parameter_key(name)))) for name in given]
    values += [("--known", "triplet", name, parameter_key(name)) for name in known]
    for option, kind, name, key in values:
        if (option, key) in there:
            raise click.UsageError(f"{option} {name}: {there[option, key]}")
        there[option, key] = "given twice"
        keys_of = pair_keys if kind == "pair" else ratio_keys
        needed = {label(one) for types in chains for one in keys_of(types)}
        if label(key) not in needed:
            raise click.UsageError(f"{option} {name}: no chain has this {kind}; there are "
                                   f"{', '.join(sorted(needed)) or 'none'}")  # fmt: skip


def _predicted(found: Any, shots: Any, sequence: str, speed: float) -> tuple[Any, list[str]]:
    """Return a prediction and what was measured of such chains: for JSON, and as lines."""
    from cradle.fit.parameters import ratio_keys

    predicted = found.predict(sequence, speed)
    rows, measured, tables, remarks = predicted.rows(), [], [], []
    keys = ratio_keys(predicted.types)
    ratios = [one for one in found.estimates.values() if one.key in keys]
    # A pair has given its restitution; ratios that are all known take nothing from the shots.
    taught = not keys or any(one.modes for one in ratios)
    for one in (one for one in shots.sets if one.types == predicted.types):
        used = one in found.shots.sets
        try:
            mean, error = (x.tolist() for x in one.mean_after(speed))
        except ValueError as reason:
            remarks.append(f"not compared: {reason}")
            continue
        measured.append({"set": one.name, "shots": len(one.shots), "fitted": used and taught,
                         "measured": mean, "error": error})  # fmt: skip
        tables.append([{**row, "measured": m, "error": e}
                       for row, m, e in zip(rows, mean, error, strict=True)])  # fmt: skip
        if not used:
            part = "left out of the fit"
        elif not taught:
            part = "not fitted: it changes no ratio"
        else:  # without a triplet's own set its ratio is known no longer
            hint = f" (for one: --without {quote(one.name)})" if len(one.types) > 3 else ""
            part = f"part of the fit: this is no check{hint}"
        remarks.append(f"measured: mean of {len(one.shots)} shots of set {one.name}, each scaled "
                       f"to {speed:g} m/s; the set was {part}")  # fmt: skip
    lines = ["", f"{sequence} at {speed:g} m/s; lower to upper: the central 95 % of predictions"]
    lines += [*map(text, tables or [rows]), *remarks]
    if several := ", ".join(one.name for one in ratios if len(one.intervals) > 1):
        groups = "come in groups, and lower to upper holds what lies between the groups too"
        lines.append(f"intervals in pieces: {several}; the predictions may {groups}")
    return {"prediction": rows, "measured": measured}, lines


@click.command()
def template() -> None:
    """Print a table of shots to fill in."""
    click.echo((data_folder() / "shots_template.csv").read_text(encoding="utf-8"), nl=False)
