"""Numbers of 32 digits: sums of two floats, high + low, kept as the two parts of a complex number.

NumPy, numba and plain Python all have arrays of complex numbers, and here these are nothing but
pairs.  Sums and products are Knuth's and Dekker's, each right to a few units of 2**-104.  The
operations have the same bits wherever floats have: no step may be reordered or contracted.
"""

import math

from cradle.kernel.state import ZERO

SPLIT = 2.0**27 + 1.0  # cuts a float into two halves, whose products are exact
ROUND = 1.5 * 2.0**52  # added and taken away again it leaves a whole number
#: The powers of ten that are floats.
TENS = (
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
)  # fmt: skip


def pair(high, low):
    """Return high + low, where low is the smaller one."""
    total = high + low
    return complex(total, low - (total - high))


def sum_of(x, y):
    """Return the sum of two floats, to the last bit."""
    total = x + y
    part = total - x
    return complex(total, (x - (total - part)) + (y - part))


def product_of(x, y):
    """Return the product of two floats, to the last bit."""
    total = x * y
    t = SPLIT * x
    xh = t - (t - x)
    xl = x - xh
    t = SPLIT * y
    yh = t - (t - y)
    yl = y - yh
    return complex(total, ((xh * yh - total) + xh * yl + xl * yh) + xl * yl)


def plus(a, b):
    """Return a + b."""
    s = sum_of(a.real, b.real)
    return pair(s.real, s.imag + (a.imag + b.imag))


def minus(a, b):
    """Return a - b."""
    s = sum_of(a.real, -b.real)
    return pair(s.real, s.imag + (a.imag - b.imag))


def negative(a):
    """Return -a."""
    return complex(-a.real, -a.imag)


def times(a, b):
    """Return a b."""
    p = product_of(a.real, b.real)
    return pair(p.real, p.imag + (a.real * b.imag + a.imag * b.real))


def scaled(a, x):
    """Return a x for a power of two x."""
    return complex(a.real * x, a.imag * x)


def over(a, b):
    """Return a / b: a first quotient, and what it leaves over."""
    q = a.real / b.real
    p = product_of(q, b.real)
    return pair(q, ((a.real - p.real) - p.imag + (a.imag - q * b.imag)) / b.real)


def root(a):
    """Return the square root of a number that is not below zero."""
    if a.real <= 0.0:
        return ZERO
    x = math.sqrt(a.real)
    p = product_of(x, x)
    return pair(x, ((a.real - p.real) - p.imag + a.imag) / (2.0 * x))


def less(a, b):
    """Tell whether a < b."""
    return a.real < b.real or (a.real == b.real and a.imag < b.imag)


def least(a, b):
    """Return the smaller one, the first of equals."""
    return b if less(b, a) else a


def most(a, b):
    """Return the larger one, the first of equals."""
    return b if less(a, b) else a


def read(x):
    """Return what a float means: the decimal of up to 15 digits that it prints as, or its bits."""
    # So .9 is nine tenths.  From 1e-7 to 1e14 the powers of ten in the way are floats themselves.
    size = abs(x)
    if not 1e-7 <= size < 1e14 or (x + ROUND) - ROUND == x:
        return complex(x, 0.0)
    # 15 digits: x 10**k lies between 1e14 and 1e15, as far as the binary exponent can tell.
    k = 15 - (math.frexp(size)[1] * 1233 + 4095) // 4096
    if size * TENS[k] < 1e14:
        k += 1
    whole = (x * TENS[k] + ROUND) - ROUND
    if whole / TENS[k] != x:
        return complex(x, 0.0)
    return over(complex(whole, 0.0), complex(TENS[k], 0.0))
