"""What the page's three-ball solver uses of numpy, for a browser: rows of numbers."""

from math import inf, pi, sqrt  # noqa: F401  (np.inf, np.pi, np.sqrt)


def each(act):
    """Return the method that does `act` number by number, with a row or with one number."""

    def method(self, other):
        others = other if isinstance(other, list) else [other] * len(self)
        return Row(map(act, self, others))

    return method


def in_place(act):
    """Return the method of +=, -=, *= or /=: as in numpy, it changes the row itself."""

    def method(self, other):
        self[:] = act(self, other)
        return self

    return method


class Row(list):
    """An array of one dimension."""

    def __getitem__(self, place):
        found = list.__getitem__(self, place)
        return Row(found) if isinstance(place, slice) else found

    def __neg__(self):
        return self * -1

    __add__ = __radd__ = each(lambda x, y: x + y)
    __sub__ = each(lambda x, y: x - y)
    __rsub__ = each(lambda x, y: y - x)
    __mul__ = __rmul__ = each(lambda x, y: x * y)
    __truediv__ = each(lambda x, y: x / y)
    __pow__ = each(lambda x, y: x**y)
    __lt__ = each(lambda x, y: x < y)
    __le__ = each(lambda x, y: x <= y)
    __gt__ = each(lambda x, y: x > y)
    __ge__ = each(lambda x, y: x >= y)
    __iadd__ = in_place(__add__)
    __isub__ = in_place(__sub__)
    __imul__ = in_place(__mul__)
    __itruediv__ = in_place(__truediv__)

    def copy(self):
        """Return the same numbers in a row of their own."""
        return Row(self)

    def round(self, digits=0):
        """Return the numbers with so many digits."""
        return Row(round(x, digits) for x in self)

    def sum(self):
        """Return the sum of all numbers."""
        return sum(self)


def array(values, dtype=None):
    """Return a row of some values."""
    return Row(map(dtype, values) if dtype else values)


def zeros(count):
    """Return a row of zeros."""
    return Row([0.0] * count)


def where(chosen, one, other):
    """Choose number by number from two rows, or from a row and a number."""
    rows = [
        row if isinstance(row, list) else [row] * len(chosen)
        for row in (one, other)
    ]
    return Row(x if yes else y for yes, x, y in zip(chosen, *rows))  # noqa: B905


def square(values):
    """Return the squares of some values."""
    return array(values) ** 2


def argmin(values):
    """Return the place of the smallest value."""
    return list(values).index(min(values))
