"""Newton's cradle by the Impulse Correlation Ratio: a companion to Ceanga and Hurmuzlu (2001).

Every impact model is a rule from a chain of balls to a path of contact impulses.

    Chain -> collide(chain, model) -> Trace -> measures -> figures

Read `cradle.textbook` first: the rules of an impact in 250 lines.  Then follow the arrows:

- `cradle.chain`, the balls before the impact; `cradle.models`, a file for each model, and the verb
  `collide`; `cradle.trace`, what happened; `cradle.measures`, what is read off it;
  `cradle.pictures`, what is drawn (matplotlib, loaded only when asked for).
- What the paper gives: `cradle.tables`, its balls and chains; `cradle.closed_form`, its formulas.
- Many impacts: `cradle.swinging`, the pendulums between them; `cradle.row`, a physics engine.
- Your own cradle: `cradle.fit`, ratios and restitution from measurements; `cradle.advice`, which
  model a scene needs; `cradle.command`, all of it from the command line, `python -m cradle`.
- Below: `cradle.kernel`, the same rules, fast; `cradle.runtime` compiles them and feeds them;
  `cradle.input`, what is asked of input, and the words of a refusal.

The distribution is called cradle-companion; its version is `cradle.__version__`.
"""

from cradle.advice import Recommendation, recommend
from cradle.chain import Chain
from cradle.models import Model, collide
from cradle.models.batch import Outcomes, outcomes, post_impact_velocities
from cradle.models.compliant import SpringChain, TimedTrace, spring_velocities
from cradle.models.correlation import ImpulseCorrelation
from cradle.models.dissipation import DissipationTrace, QuadraticDissipation
from cradle.models.energy import EnergyDistribution, EnergyTrace
from cradle.models.sequential import FusedChain, SequentialCollisions
from cradle.runtime.job import warm_up
from cradle.swinging.pendulums import Pendulums
from cradle.swinging.record import Impact, Swing
from cradle.swinging.swing import swing
from cradle.tables import paper_chain, paper_sequences, ratio_table, restitution_table
from cradle.trace import Event, ImpactNotCertified, ImpactNotFinished, Trace

__all__ = [
    "Chain", "DissipationTrace", "EnergyDistribution", "EnergyTrace", "Event", "FusedChain",
    "Impact", "ImpactNotCertified", "ImpactNotFinished", "ImpulseCorrelation", "Model", "Outcomes",
    "Pendulums", "QuadraticDissipation", "Recommendation", "SequentialCollisions", "SpringChain",
    "Swing", "TimedTrace", "Trace", "collide", "outcomes", "paper_chain", "paper_sequences",
    "post_impact_velocities", "ratio_table", "recommend", "restitution_table", "spring_velocities",
    "swing", "warm_up",
]  # fmt: skip


def __getattr__(name: str) -> str:
    """Return the version of the installed distribution; looked up when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module 'cradle' has no attribute {name!r}")
    from importlib.metadata import version

    return version("cradle-companion")
