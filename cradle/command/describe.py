"""What a command is told of a chain: options, the chain and model they mean, what is assumed."""

import math
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import click
import numpy as np

import cradle
from cradle.advice.choice import made, own_viscosity
from cradle.input.values import ABOVE_ZERO, one_number, whole_number

UNITS = {"kg": 1.0, "g": 1e-3}


def numbers_of(_: click.Context, __: click.Parameter, value: str | None) -> list[float] | None:
    """Read numbers with commas between them; a minus sign may be the typographic one."""
    try:
        return None if value is None else [*map(float, value.replace("\u2212", "-").split(","))]
    except ValueError:
        raise click.BadParameter(f"{value!r}; write numbers with commas between") from None


_CHAIN = (
    click.Argument(["sequence"], required=False),
    click.Option(["--speed"], type=float, help="Velocity of the first ball, m/s [1]."),
    click.Option(["--masses"], callback=numbers_of, help="Masses, left to right: 45,53,53."),
    click.Option(["--unit"], type=click.Choice(list(UNITS)), help="Of masses [kg]."),
    click.Option(["--velocities"], callback=numbers_of, help="Instead of --speed: 1,0,0."),
    click.Option(["--restitution"], callback=numbers_of, help="One, or one per contact [1]."),
    click.Option(["--model"], type=click.Choice(["ratio", "spheres", "sequential"]),
                 help="How the balls collide: by ratios, as spheres (Hertz; with losses viscous "
                 "ones, or the energy law if they lose too much for that), or one pair after the "
                 "other [ratio if there are ratios or two balls, else spheres]."),
    click.Option(["--stiffness"], callback=numbers_of, help="Of the contacts of spheres, N/m^1.5: "
                 "one, or one per contact [1; forces, times and solve --gaps need it]."),
    click.Option(["--gaps"], callback=numbers_of, help="Between the balls, m; for solve below 0 "
                 "where strings press them together [0]."),
    click.Option(["--ratio"], callback=numbers_of, help="One, or one per inner ball."),
    click.Option(["--backward"], callback=numbers_of, help="Ratios from the right [as --ratio]."),
    click.Option(["--saturate"], is_flag=True, help="Admit ratios above their bound."),
)  # fmt: skip


def chain_options(*without: str) -> list[click.Parameter]:
    """Return what describes a chain and its law, but for some options."""
    return [one for one in _CHAIN if one.name not in without]


def swing_options(otherwise: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add what describes the pendulums; see `pendulum_length`."""
    length = click.option("--length", type=float, help=f"Of the pendulums, m [{otherwise}].")
    period = click.option("--period", type=float, help="Instead: of a small swing to and fro, s.")
    return lambda command: length(period(command))


def pendulum_length(length: float | None, period: float | None) -> float | None:
    """Return the length of pendulums that have this length, or this period of small swings."""
    if length is not None and period is not None:
        raise click.UsageError("give one of --length and --period")
    if period is None:
        return length
    one_number("--period", period, *ABOVE_ZERO)
    return 9.81 * (0.5 * period / math.pi) ** 2


class Described(NamedTuple):
    """A chain, how it collides, what was not given and stands for it, and the paper's types."""

    chain: cradle.Chain
    taken: cradle.Chain  # as the model takes it: springs have a viscosity, not a restitution
    model: cradle.Model
    assumed: tuple[str, ...]
    letters: str

    @property
    def note(self) -> str:
        """The model, and what is assumed, for people."""
        assumed = f"\nassumed: {'; '.join(self.assumed)}" if self.assumed else ""
        return f"model: {made(self.model)}{assumed}"


def described(
    sequence: str | None, masses: list[float] | None, unit: str | None,
    restitution: list[float] | None, ratio: list[float] | None, backward: list[float] | None,
    saturate: bool, *, speed: float | None = None, velocities: list[float] | None = None,
    model: str | None = None, stiffness: list[float] | None = None,
    gaps: list[float] | None = None,
) -> Described:  # fmt: skip
    """Return the chain and the model that the options describe."""
    assumed = []
    if sequence is not None and sequence[:1].isdecimal() and masses is None:
        size = int(sequence) if sequence.isdecimal() and len(sequence) < 10 else sequence
        masses = [1.0] * whole_number("SEQUENCE", size, "2 to 1000000 balls", 2, 1_000_000)
        sequence = None
        assumed.append(f"{len(masses)} equal balls of 1 {unit or 'kg'}")
    if (sequence is None) == (masses is None):
        need = "how many equal balls, such as 5; a sequence of the paper's balls, such as ABCCA"
        raise click.UsageError(f"give one of: {need}; --masses{', not both' * bool(masses)}")
    if model not in (None, "ratio") and (ratio or backward or saturate):
        raise click.UsageError(f"--model {model} has no ratios; leave them out, and --saturate")
    if not (speed is None or velocities is None):
        raise click.UsageError("give one of --speed and --velocities")
    striker = 1.0 if speed is None else one_number("speed", speed)
    excess: Literal["raise", "saturate"] = "saturate" if saturate else "raise"
    law: cradle.Model
    if masses is None:
        given = {"--unit": unit, "--velocities": velocities, "--restitution": restitution,
                 "--ratio": ratio, "--backward": backward}  # fmt: skip
        for name, value in given.items():
            if value is not None:
                raise click.UsageError(f"{name} goes with --masses; {sequence} has its own values")
        letters = str(sequence).upper()
        chain, law = cradle.paper_chain(letters, striker, excess=excess)
    else:
        letters, before = "-" * len(masses), velocities or [striker] + [0.0] * (len(masses) - 1)
        balls = [UNITS[unit or "kg"] * m for m in masses]
        chain = cradle.Chain(balls, before, one_or_all(restitution or [1.0]))
        assumed += [] if velocities else [f"the first ball strikes at {striker:g} m/s"]
        assumed += [] if restitution else ["contacts lose no energy (--restitution)"]
        if ratio is None and (model == "ratio" or backward or saturate):
            raise click.UsageError("ratios need --ratio, such as 0.1 or one for each inner ball")
        ratios = one_or_all(ratio or [0.0]), one_or_all(backward)  # without effect on two balls
        law = cradle.ImpulseCorrelation(*ratios, excess=excess)
    taken = chain
    if bare := masses and ratio is None and model is None and len(chain) > 2:
        model = "spheres"
    if model != "spheres" and (stiffness or gaps):
        raise click.UsageError("--stiffness and --gaps are those of --model spheres")
    if gaps and not stiffness:
        raise click.UsageError("--gaps need --stiffness, about 1e10 for steel balls of 1 cm")
    if model == "sequential":
        law = cradle.SequentialCollisions()
    elif model == "spheres":
        taken, law, kind = as_spheres(chain, stiffness, gaps)
        assumed += [f"the balls collide as {kind} (--model, --ratio)"] if bare else []
        alike = stiffness is not None or np.ptp(chain.masses) == 0.0
        assumed += [] if alike else ["equally stiff contacts (--stiffness)"]
    as_fast = (chain.velocities[1:] == chain.velocities[:-1]) & (chain.velocities[1:] != 0.0)
    assumed += as_one(bool(as_fast.any()), gaps, model)
    closing = np.flatnonzero(chain.closing_speeds > 0.0)
    sides = closing.size > 1 and bool((chain.closing_speeds[closing[0] : closing[-1]] >= 0.0).all())
    if sides and isinstance(law, cradle.ImpulseCorrelation):
        assumed += ["what is struck from both sides is driven by the left contact (rule R2)"]
    return Described(chain, taken, law, tuple(assumed), letters)


def as_spheres(
    chain: cradle.Chain, stiffness: list[float] | None, gaps: list[float] | None
) -> tuple[cradle.Chain, cradle.Model, str]:
    """Return a chain as spheres take it, their law, and what kind of spheres they are."""
    k, wide = one_or_all(stiffness or [1.0]), one_or_all(gaps or [0.0])
    try:
        law = cradle.SpringChain(k, viscosity=own_viscosity(chain, k), gaps=wide)
    except ValueError:
        if gaps or (chain.restitution == 1.0).all():
            raise  # it is not the restitution
        lossy = "spheres that lose more than viscous ones can, by the energy law"
        return chain, cradle.EnergyDistribution(k), lossy
    viscous = f"viscous spheres; restitution at {chain.closing_speeds.max():.3g} m/s"
    kind = viscous if law.viscosity else "elastic spheres"
    return cradle.Chain(chain.masses, chain.velocities), law, kind


def as_one(alike: bool, gaps: list[float] | None, model: str | None) -> list[str]:
    """Return what is assumed where neighbours move alike."""
    told = "balls that move alike strike as one; those of a toy come one by one (--gaps)"
    return [told] * (alike and not gaps and model != "sequential")


def one_or_all(values: list[float] | None) -> Any:
    """Return one number for all, or the list."""
    return values[0] if values and len(values) == 1 else values
