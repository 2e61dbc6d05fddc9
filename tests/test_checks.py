"""What counts as a number, and how a value that does not is named."""

import re
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pandas as pd
import pytest
import sympy

from cradle import Chain, ImpulseCorrelation, collide, post_impact_velocities
from cradle.input.values import numbers, one_number, shown, whole_number


class Uncertain:
    """As the numbers of the package `uncertainties`: it has `__float__`, which refuses."""

    def __float__(self):
        raise TypeError("can't convert an affine function to float; use x.nominal_value")

    def __repr__(self):
        return "0.9+/-0.1"


ACCEPTED = [
    (0.25, 0.25),
    ([1, 2.5], [1.0, 2.5]),
    ([Decimal("0.1"), Fraction(1, 3)], [0.1, 1 / 3]),
    (Fraction(1, 8), 0.125),
    ([[Decimal(1)], [Fraction(2)]], [[1.0], [2.0]]),
    (np.array([1, Fraction(1, 2)], dtype=object), [1.0, 0.5]),
    ([mpmath.mpf(1) / 4, sympy.Rational(1, 2)], [0.25, 0.5]),
    ([2**70, 1], [2.0**70, 1.0]),
    ([np.float32(0.5), np.int8(3), np.longdouble(2)], [0.5, 3.0, 2.0]),
    (pd.Series([1, 2], index=[7, 8]), [1.0, 2.0]),
    (np.ma.array([1.0, 2.0]), [1.0, 2.0]),
    ([[1, 2], np.array([3.0, 4.0])], [[1.0, 2.0], [3.0, 4.0]]),
    (range(3), [0.0, 1.0, 2.0]),
    ([], []),
    ([[], []], [[], []]),
]


@pytest.mark.parametrize(("values", "floats"), ACCEPTED, ids=[repr(v) for v, _ in ACCEPTED])
def test_accepted(values, floats):
    array = numbers("x", values)
    assert array.dtype == np.float64
    assert array.tolist() == floats
    assert array is not values


def test_an_array_of_floats_is_not_copied():
    array = np.ones(3)
    assert numbers("x", array) is array


WHOLE = "must be real numbers"
REFUSED = [
    (True, f"x = True; {WHOLE}"),
    ([0.5, True], "x[1] = True; must be a real number"),
    (np.array([True, False]), "x[0] = np.True_; must be a real number"),
    ("0.5", f"x = '0.5'; {WHOLE}"),
    ([[1, 2], [3, "4"]], "x[1, 1] = '4'; must be a real number"),
    (1j, f"x = 1j; {WHOLE}"),
    (np.array([1, 2j]), "x[0] = (1+0j); must be a real number"),
    (np.ma.masked, f"x = masked; {WHOLE}"),
    ([1, np.ma.masked], "x[1] = masked; must be a real number"),
    (np.ma.array([1.0, 2.0], mask=[False, True]), "x[1] = masked; must be a real number"),
    # NumPy makes floats of nanoseconds, of seconds none.
    (np.array([1, 2], "m8[ns]"), "x[0] = np.timedelta64(1,'ns'); must be a real number"),
    (Uncertain(), f"x = 0.9+/-0.1 (test_checks.Uncertain); {WHOLE}"),
    ([pd.NA, 1], "x[0] = <NA> (pandas."),
    ({"a": 1}, "x = {'a': 1}; must be real numbers"),
    (Decimal("1e400"), "x = Decimal('1E+400'); must be within the range of floats"),
    ([1, 10**400], "x[1] = 1000000000"),
    ([1, [2, 3]], "x[1] has shape (2,), x[0] has (); must have one shape"),
    ([[1, 2], [3]], "x[1] has shape (1,), x[0] has (2,); must have one shape"),
    ([[[1], [2, 3]], 4], "x[0, 1] has shape (2,), x[0, 0] has (1,); must have one shape"),
]


@pytest.mark.parametrize(("values", "message"), REFUSED, ids=[m for _, m in REFUSED])
def test_refused(values, message):
    with pytest.raises(ValueError, match="^" + re.escape(message)):
        numbers("x", values)


@pytest.mark.skipif(np.finfo(np.longdouble).max <= np.finfo(float).max, reason="no long doubles")
@pytest.mark.parametrize("where", [lambda x: x, lambda x: [1, x], lambda x: np.array([1, x])])
def test_long_doubles_beyond_floats(where):
    large = np.longdouble("1e400")
    with pytest.raises(ValueError, match=r"^x(\[1\])? = 1e\+400; must be within the range of"):
        numbers("x", where(large))
    assert numbers("x", np.longdouble("inf")) == np.inf  # whether it may be, others decide


@pytest.mark.parametrize("bad", ["one", None, 2j, [1, 2], "x" * 10_000])
def test_a_bad_cell_of_a_long_list_does_not_print_the_list(bad):
    with pytest.raises(ValueError, match=r"^masses\[(5000|5001)\] ") as error:
        Chain([1.0] * 5000 + [bad] + [1.0] * 5000, np.zeros(10_001))
    assert len(str(error.value)) < 200


def test_long_values_are_cut():
    for check in (one_number, whole_number):
        with pytest.raises(ValueError, match=r"\.\.\.; must be") as error:
            check("step", list(range(10_000)))
        assert len(str(error.value)) < 200


def test_of_a_long_list_only_the_beginning_is_written():
    class Loud:
        written = 0

        def __repr__(self):
            Loud.written += 1
            return "loud"

    assert shown([Loud()] * 10_000).endswith("...")
    assert Loud.written < 100


def test_fractions_and_decimals_go_through():
    """To the bit what their floats give."""
    exact = Chain([Fraction(1), Decimal("0.5"), 2], [Fraction(1), 0, 0], Decimal("0.9"))
    plain = Chain([1, 0.5, 2], [1, 0, 0], 0.9)
    assert exact == plain
    after = collide(exact, ImpulseCorrelation(Fraction(1, 8))).velocities
    assert after.tolist() == collide(plain, ImpulseCorrelation(0.125)).velocities.tolist()
    ratios = [Fraction(1, 8)]
    several = post_impact_velocities([Fraction(1), Decimal("0.5"), 2], [1, 0, 0], 0.9, ratios)
    assert several.tolist() == after.tolist()
