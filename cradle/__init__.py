"""Newton's cradle by the Impulse Correlation Ratio: a companion to Ceanga and Hurmuzlu (2001).

>>> from cradle import Chain, ImpulseCorrelation, collide
>>> collide(Chain([1, 1, 1], [1, 0, 0]), ImpulseCorrelation(0.15)).velocities.round(3).tolist()
[-0.081, 0.088, 0.993]

Every impact model is a rule from a chain of balls to a path of contact impulses::

    Chain -> collide(chain, model) -> Trace -> measures -> figures

Read `cradle.textbook` first: the rules of an impact in 250 lines.  Then follow the arrows:

- `chain`, the balls before the impact; `models`, a file for each model, and the verb `collide`;
  `trace`, what happened; `measures`, what is read off it; `pictures`, what is drawn (matplotlib,
  loaded only when asked for).
- What the paper gives: `tables`, its balls and chains; `closed_form`, its formulas.
- Many impacts: `swinging`, the pendulums between them; `row`, a physics engine.
- Your own cradle: `fit`, ratios and restitution from measurements; `advice`, which model a scene
  needs; `command`, all of it from the command line, `python -m cradle`.
- Below: `kernel`, the same rules, fast; `runtime` compiles them and feeds them; `input`, what is
  asked of input, and the words of a refusal.
"""

from cradle.advice.choice import Recommendation, recommend
from cradle.chain import Chain
from cradle.models import Model, collide
from cradle.models.batch import Outcomes, outcomes, post_impact_velocities
from cradle.models.compliant import SpringChain, hertz_stiffness, spring_outcomes, spring_velocities
from cradle.models.correlation import ImpulseCorrelation
from cradle.models.dissipation import DissipationTrace, QuadraticDissipation
from cradle.models.energy import EnergyDistribution, EnergyTrace
from cradle.models.sequential import FusedChain, SequentialCollisions
from cradle.models.speed import ConstantLoss, SpeedDependent, ViscousLoss, viscosity_from
from cradle.models.springs import TimedTrace
from cradle.runtime.job import warm_up
from cradle.swinging.pendulums import Pendulums
from cradle.swinging.record import Impact, Swing
from cradle.swinging.swing import swing
from cradle.tables import paper_chain, paper_sequences, ratio_table, restitution_table
from cradle.trace import Event, ImpactNotCertified, ImpactNotFinished, Trace

__all__ = [
    "Chain", "ConstantLoss", "DissipationTrace", "EnergyDistribution", "EnergyTrace", "Event",
    "FusedChain", "Impact", "ImpactNotCertified", "ImpactNotFinished", "ImpulseCorrelation",
    "Model", "Outcomes", "Pendulums", "QuadraticDissipation", "Recommendation",
    "SequentialCollisions", "SpeedDependent", "SpringChain", "Swing", "TimedTrace", "Trace",
    "ViscousLoss", "collide", "hertz_stiffness", "outcomes", "paper_chain", "paper_sequences",
    "post_impact_velocities", "ratio_table", "recommend", "restitution_table", "spring_outcomes",
    "spring_velocities", "swing", "viscosity_from", "warm_up",
]  # fmt: skip


def __getattr__(name: str) -> str:
    """Return `__version__`, that of the distribution cradle-companion, when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module 'cradle' has no attribute {name!r}")
    from importlib.metadata import version

    return version("cradle-companion")
