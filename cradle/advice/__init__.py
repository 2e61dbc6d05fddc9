"""Which model a scene needs: from what is known and what is wanted, by what was measured."""

from cradle.advice.choice import Recommendation, recommend

__all__ = ["Recommendation", "recommend"]
