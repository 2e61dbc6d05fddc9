"""Newton's cradle by the Impulse Correlation Ratio: a companion to Ceanga and Hurmuzlu (2001).

One idea: every impact model is a rule from a chain of balls to a path of contact impulses.

    Chain -> collide(chain, model) -> Trace -> measures -> figures

Folders are roles:

- on top `cradle.chain`, the chain before the impact; `cradle.trace`, what happened;
  `cradle.textbook`, `cradle.closed_form` and `cradle.tables`, what the paper gives;
  `cradle.measures`, what is read off outcomes; `cradle.row`, balls that a physics engine moves.
- `cradle.input`: what is asked of input, and the words of a refusal.
- `cradle.kernel`: the event loop; `cradle.runtime` compiles it and feeds it.
- `cradle.models`: one file a model, and the verb `collide`.
- `cradle.swinging`: impacts and pendulums in turn; `cradle.swinging.stride`, one step of a `Row`.
- `cradle.fit`: ratios and restitution from measured velocities.
- `cradle.advice`: which model a scene needs, by what was measured.
- `cradle.pictures`: matplotlib, imported only when asked for.
- `cradle.command`: the command line, `python -m cradle`.

Read `cradle.textbook` first: the rules of an impact in 250 lines.  The distribution is called
cradle-companion; its version is `cradle.__version__`.
"""

from cradle.advice import Recommendation, recommend
from cradle.chain import Chain
from cradle.models import Model, collide
from cradle.models.batch import Outcomes, outcomes, post_impact_velocities
from cradle.models.compliant import SpringChain, TimedTrace
from cradle.models.correlation import ImpulseCorrelation
from cradle.models.dissipation import DissipationTrace, QuadraticDissipation
from cradle.models.energy import EnergyDistribution, EnergyTrace
from cradle.models.sequential import FusedChain, SequentialCollisions
from cradle.models.springs import spring_velocities
from cradle.runtime.job import warm_up
from cradle.swinging.pendulums import Pendulums
from cradle.swinging.record import Impact, Swing
from cradle.swinging.swing import swing
from cradle.tables import paper_chain, paper_sequences, ratio_table, restitution_table
from cradle.trace import Event, ImpactNotCertified, ImpactNotFinished, Trace

__all__ = [
    "Chain",
    "DissipationTrace",
    "EnergyDistribution",
    "EnergyTrace",
    "Event",
    "FusedChain",
    "Impact",
    "ImpactNotCertified",
    "ImpactNotFinished",
    "ImpulseCorrelation",
    "Model",
    "Outcomes",
    "Pendulums",
    "QuadraticDissipation",
    "Recommendation",
    "SequentialCollisions",
    "SpringChain",
    "Swing",
    "TimedTrace",
    "Trace",
    "collide",
    "outcomes",
    "paper_chain",
    "paper_sequences",
    "post_impact_velocities",
    "ratio_table",
    "recommend",
    "restitution_table",
    "spring_velocities",
    "swing",
    "warm_up",
]


def __getattr__(name: str) -> str:
    """Return the version of the installed distribution; looked up when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module 'cradle' has no attribute {name!r}")
    from importlib.metadata import version

    return version("cradle-companion")
