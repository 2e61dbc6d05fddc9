"""Shots of the paper's balls, as many and as exact as a test wants them."""

import numpy as np

from cradle import collide, paper_chain

MASS = {"A": 0.045, "B": 0.053, "C": 0.053, "D": 0.166}


def columns(name, speeds, after, sigma, errors=None):
    """Shots of the paper's balls as columns; `after` at unit speed of the striker."""
    errors = np.zeros((len(speeds), len(name))) if errors is None else errors
    rows = [
        (name, shot, ball + 1, letter, MASS[letter], 0.0 if ball else speed,
         speed * after[ball] + errors[shot][ball], sigma)
        for shot, speed in enumerate(speeds) for ball, letter in enumerate(name)
    ]  # fmt: skip
    keys = ("set", "shot", "ball", "type", "mass", "before", "after", "sigma")
    return dict(zip(keys, map(list, zip(*rows))))


def outcome(name):
    chain, model = paper_chain(name, excess="saturate")
    return collide(chain, model).velocities
