"""Which model a scene needs: from what is known and what is wanted, by what was measured."""

from cradle.advice.choice import recommend
from cradle.advice.recommendation import Recommendation

__all__ = ["Recommendation", "recommend"]
