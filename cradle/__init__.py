"""Newton's cradle by the Impulse Correlation Ratio: a companion to Ceanga and Hurmuzlu (2001).

One idea: every impact model is a rule from a chain of balls to a path of contact impulses.

    Chain -> collide(chain, model) -> Trace -> measures -> figures

The rooms, in that order:

- `cradle.chain`: the chain before the impact.
- `cradle.trace`: what happened.
- `cradle.kernel`: the event loop; `cradle.runtime` compiles it.
- `cradle.models`: one file a model, and the verb `collide`.
- `cradle.swinging`: impacts and pendulums in turn; `cradle.pendulums`, `cradle.flight` and
  `cradle.resting` say how balls hang, fly and rest against each other, `cradle.swing_trace`
  what happened.
- `cradle.closed_form`: what the paper gives in closed form.
- `cradle.tables`: the paper's tables and chains.
- `cradle.measures`: what is read off outcomes.
- `cradle.figures` and `cradle.animation`: matplotlib, imported only when asked for;
  `cradle.film`: keyframes.
"""

from cradle.chain import Chain
from cradle.models import Model, collide
from cradle.models.compliant import SpringChain, TimedTrace
from cradle.models.correlation import ImpulseCorrelation, post_impact_velocities
from cradle.models.dissipation import DissipationTrace, QuadraticDissipation
from cradle.models.energy import EnergyDistribution, EnergyTrace
from cradle.models.sequential import FusedChain, SequentialCollisions
from cradle.pendulums import Pendulums
from cradle.swing_trace import Impact, Swing
from cradle.swinging import swing
from cradle.tables import paper_chain, paper_sequences, ratio_table, restitution_table
from cradle.trace import Event, ImpactNotFinished, Trace

__all__ = [
    "Chain",
    "DissipationTrace",
    "EnergyDistribution",
    "EnergyTrace",
    "Event",
    "FusedChain",
    "Impact",
    "ImpactNotFinished",
    "ImpulseCorrelation",
    "Model",
    "Pendulums",
    "QuadraticDissipation",
    "SequentialCollisions",
    "SpringChain",
    "Swing",
    "TimedTrace",
    "Trace",
    "collide",
    "paper_chain",
    "paper_sequences",
    "post_impact_velocities",
    "ratio_table",
    "restitution_table",
    "swing",
]
