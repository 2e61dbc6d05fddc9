"""Impacts and pendulums in turn."""
