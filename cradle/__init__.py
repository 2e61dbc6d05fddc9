"""Newton's cradle by the Impulse Correlation Ratio: a companion to Ceanga and Hurmuzlu (2001).

One idea: every impact model is a rule from a chain of balls to a path of contact impulses.

    Chain -> collide(chain, model) -> Trace -> measures -> figures

The rooms, in that order:

- `cradle.chain`: the chain before the impact; `cradle.checks` and `cradle.reals`: what is asked of
  input; `cradle.refusals`: the words of an error; `cradle.drawing`: pictures and tables;
  `cradle.progress`: a bar.
- `cradle.trace`: what happened.
- `cradle.kernel`: the event loop; `cradle.runtime` compiles it, `cradle.drive` feeds it.
- `cradle.models`: one file a model, and the verb `collide`.
- `cradle.swinging`: impacts and pendulums in turn; `cradle.pendulums`, `cradle.flight` and
  `cradle.resting` say how balls hang, fly and rest against each other, `cradle.swing_trace`
  what happened.
- `cradle.row`: a row of balls that a physics engine moves; `cradle.stride`: one step of it.
- `cradle.closed_form`: what the paper gives in closed form; `cradle.conserving`: all outcomes of
  three balls that conserve energy.
- `cradle.tables`: the paper's tables and chains, read by `cradle.reading`.
- `cradle.advice`: which model a scene needs, by what was measured.
- `cradle.measures`: what is read off outcomes; `cradle.blocks`: batches under dask.
- `cradle.fit`: ratios and restitution from measured velocities.
- `cradle.figures` and `cradle.animation`: matplotlib, imported only when asked for;
  `cradle.film`: keyframes.
- `cradle.command`: the command line, `python -m cradle`.

Read `cradle.textbook` first: the rules of an impact in 250 lines.  The distribution is called
cradle-companion; its version is `cradle.__version__`.
"""

from cradle.advice import Recommendation, recommend
from cradle.chain import Chain
from cradle.drive import warm_up
from cradle.models import Model, collide
from cradle.models.batch import Outcomes, outcomes, post_impact_velocities
from cradle.models.compliant import SpringChain, TimedTrace
from cradle.models.correlation import ImpulseCorrelation
from cradle.models.dissipation import DissipationTrace, QuadraticDissipation
from cradle.models.energy import EnergyDistribution, EnergyTrace
from cradle.models.sequential import FusedChain, SequentialCollisions
from cradle.pendulums import Pendulums
from cradle.swing_trace import Impact, Swing
from cradle.swinging import swing
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
    "swing",
    "warm_up",
]


def __getattr__(name: str) -> str:
    """Return the version of the installed distribution; looked up when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module 'cradle' has no attribute {name!r}")
    from importlib.metadata import version

    return version("cradle-companion")
