"""Newton's cradle by the Impulse Correlation Ratio: a companion to Ceanga and Hurmuzlu (2001).

One idea: every impact model is a rule from a chain of balls to a path of contact impulses.

    Chain -> collide(chain, model) -> Trace -> measures -> figures

The rooms, in that order:

- `cradle.chain`: the chain before the impact.
- `cradle.trace`: what happened.
- `cradle.kernel`: the event loop; `cradle.runtime` compiles it.
- `cradle.models`: one file a model, and the verb `collide`.
- `cradle.closed_form`: what the paper gives in closed form.
- `cradle.tables`: the paper's tables and chains.
- `cradle.measures`: what is read off outcomes.
- `cradle.fit`: ratios and restitution from measured velocities.
- `cradle.figures`: matplotlib, imported only when asked for.
- `cradle.command`: the command line, `python -m cradle`.
"""

from cradle.chain import Chain
from cradle.models import Model, collide
from cradle.models.compliant import SpringChain, TimedTrace
from cradle.models.correlation import ImpulseCorrelation, post_impact_velocities
from cradle.models.dissipation import DissipationTrace, QuadraticDissipation
from cradle.models.energy import EnergyDistribution, EnergyTrace
from cradle.models.sequential import FusedChain, SequentialCollisions
from cradle.tables import paper_chain, paper_sequences, ratio_table, restitution_table
from cradle.trace import Event, ImpactNotFinished, Trace

__all__ = [
    "Chain",
    "DissipationTrace",
    "EnergyDistribution",
    "EnergyTrace",
    "Event",
    "FusedChain",
    "ImpactNotFinished",
    "ImpulseCorrelation",
    "Model",
    "QuadraticDissipation",
    "SequentialCollisions",
    "SpringChain",
    "TimedTrace",
    "Trace",
    "collide",
    "paper_chain",
    "paper_sequences",
    "post_impact_velocities",
    "ratio_table",
    "restitution_table",
]
