"""The name under which some tests and benchmarks know `truth`."""

from truth import EventLimit, Impact, solve

__all__ = ["EventLimit", "Impact", "solve"]
