"""Three balls of which the first strikes: the map from one collision to the next."""

from scipy.optimize import brentq, minimize_scalar


def turn(zeta, r, e, alpha):
    b, a = 1 - alpha * (1 + r), 1 - alpha + r
    x = (1 + r) * zeta - b
    kappa = 1.0 if x > 0 else e * e
    return x, e * b**0.5, ((kappa * alpha * x * x + e * e * a * b) / (1 + r)) ** 0.5, a


def by_turns(r1, r2, e, alpha, most=10_000):
    """Number of collisions and velocities after the impact."""
    zeta, s, number = e * (1 - alpha + r1) / (1 + e), (1 + e) / (1 - alpha + r1), 2
    while number < most:
        x, limit, y, a = turn(zeta, (r2, r1)[number % 2], e, alpha)
        if x >= limit:
            break
        zeta, s, number = a * y / (y - x), s * (y - x) / a, number + 1
    r = (r2, r1)[number % 2]
    b = 1 - alpha * (1 + r)
    u = s * ((b + e * b**0.5) / (1 + r) - zeta), -s * e * b**0.5
    u1, u2 = u if number % 2 == 0 else u[::-1]
    v2 = (1 / r1 - u1 / r1 + u2 / r2) / (1 / r1 + 1 + 1 / r2)
    return number, [v2 + u1, v2, v2 - u2]


def excess(r1, r2, e, alpha):
    """Smallest rise of zeta in one cycle: negative where the sequence is infinite."""

    def rise(zeta):
        end = zeta
        for r in (r2, r1):
            x, limit, y, a = turn(end, r, e, alpha)
            if x >= limit:
                return 1.0
            end = a * y / (y - x)
        return end - zeta

    b = 1 - alpha * (1 + r2)
    top = (b + e * b**0.5) / (1 + r2)
    return minimize_scalar(rise, bounds=(0, top), method="bounded", options={"xatol": 1e-12}).fun


def edge(r2, e, alpha):
    """Largest r1 with an infinite sequence."""
    return brentq(lambda r1: excess(r1, r2, e, alpha), 1e-9, 4.0, xtol=1e-14)


def last_with(counted, low=1e-3, high=4.0):
    """Largest r1 for which something is true, by bisection: the numbers on both sides of it."""
    while high - low > 1e-12:
        middle = (low + high) / 2
        low, high = (middle, high) if counted(middle) else (low, middle)
    return low, high
