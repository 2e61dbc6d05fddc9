"""Which model a scene needs: from what is known and what is wanted, by what was measured.

No number is an estimate.  It was measured on this very chain, or is the worst of those measured on
chains around it, or there is none.  `measured` reads the table, `choice` chooses from it.
"""

from cradle.advice.choice import recommend
from cradle.advice.recommendation import Recommendation

__all__ = ["Recommendation", "recommend"]
