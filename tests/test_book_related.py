"""What book/related.ipynb draws and its chart says, by second routes."""

import math

import convex
import numpy as np
import pytest
from chapters import Chapter, floats
from dop853 import integrated
from energy_law import strike
from scipy.optimize import brentq
from truth import solve

CHAPTER = Chapter("related")
E = 0.8


def forces(loss):
    """Three viscous spheres, by SciPy."""
    return integrated([1] * 3, [1, 0, 0], loss=loss)


def restitution(loss):
    """Two viscous spheres that meet at the speed 1."""
    first, second = integrated([1] * 2, [1, 0], loss=loss)
    return second - first


def one_body(e):
    """Ball 1 against a body of two: momentum, and Newton's rule."""
    together = (1 + e) / 3
    return [1 - 2 * together, together, together]


def rigid(e, ratio):
    return floats(solve([1] * 3, [1, 0, 0], e, ratio).velocities)


def test_fig_related_outcomes():
    """Every ball of six laws, without and with losses."""
    loss = brentq(lambda loss: restitution(loss) - E, 0.05, 0.2, xtol=1e-7)
    panels = CHAPTER.figures["fig-related-outcomes"].axes
    names = [label.get_text() for label in panels[0].get_yticklabels()]
    assert panels[1].get_title(loc="left") == f"restitution {E}"
    for ax, e in zip(panels, (1, E), strict=True):
        expected = {
            "pairs": rigid(e, 0),
            "ratio 0.15": rigid(e, 0.15),
            "energy law": strike([1] * 3, [1, 0, 0], e, 3000)[0],
            "forces": forces(loss if e < 1 else 0),
            "convex": convex.strike(e) if e < 1 else one_body(1),
            "one body": one_body(e),
        }
        assert names == list(expected)
        shown = {line.get_label(): line.get_xydata()[0] for line in ax.get_lines()}
        written = {tuple(text.xy): text.get_text() for text in ax.texts}
        for row, (name, after) in enumerate(expected.items()):
            for ball, v in enumerate(after, 1):
                x, y = shown[f"{name}, {ball}"]
                assert x == pytest.approx(v, abs=1e-3)
                assert round(y) == row
                assert written[x, y] == str(ball)
                told = written[1.22 + 0.22 * (ball - 1), row].replace("−", "-")
                assert float(told) == pytest.approx(v, abs=6e-3)
        # What the text, and the words for those who do not see it, say of them.
        first = {name: after[0] for name, after in expected.items()}
        assert max(first, key=first.get) == "pairs"
        assert min(first.values()) == pytest.approx(first["one body"], abs=1e-6)
        pair = np.abs(np.subtract(expected["energy law"], expected["forces"])).max()
        assert pair < 1e-3 if e == 1 else pair > 0.03
        apart = [
            np.abs(np.subtract(expected[one], expected[other])).max()
            for k, one in enumerate(names)
            for other in names[:k]
        ]
        assert e == 1 or min(apart) > 0.01
    # Between pairs and one body: the ends of the ratio.
    np.testing.assert_allclose(rigid(1, 0), [0, 0, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rigid(1, 0.5), one_body(1), rtol=0, atol=1e-9)


def test_border_of_endless_collisions():
    assert 7 - 4 * math.sqrt(3) == pytest.approx(0.072, abs=5e-4)
