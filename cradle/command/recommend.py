"""`cradle recommend`: which impact law to use."""

from collections.abc import Sequence
from typing import Any

import click

import cradle
from cradle.command.describe import chain_options, described, one_or_all


@click.command(params=chain_options("model", "gaps"))
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
