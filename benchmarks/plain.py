"""The kernel as it stands, with a limit or a function exchanged: what each is there for."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from problem import case

from cradle.kernel.state import LIMITS, UNDECIDED
from cradle.runtime import compile as runtime
from cradle.runtime import job as drive

CODE = compile(runtime.unit(), "kernel.py", "exec")


def rooms(**exchanged: Any) -> dict[str, Any]:
    """All names of the kernel; fields of `LIMITS` and functions exchanged as told.

    A function is exchanged by one that takes the names of the kernel and gives the other function.
    """
    names: dict[str, Any] = {"__name__": "kernel"}
    exec(CODE, names)
    limits = {name: value for name, value in exchanged.items() if name in LIMITS._fields}
    names["LIMITS"] = names["LIMITS"]._replace(**limits)
    for name in exchanged.keys() - limits.keys():
        assert isinstance(names[name], Callable), name
        names[name] = exchanged[name](dict(names))
    return names


def solve(
    m, v, e, forward, backward=None, *, meeting=0.5, max_events=10**6, room=0, kernel=None,
    area=drive._area, **exchanged,
):  # fmt: skip
    """Solve one impact by the plain event loop; return all that it leaves."""
    names = kernel or rooms(**exchanged)
    n = len(m)
    inputs = names["Inputs"](*([part] for part in case(m, v, e, forward, backward)[:5]))
    state, out = area(n, False, drive._record(room, n)), drive.outputs(1, n, last=True)
    state.tally[0].room = plenty = 2**62
    options = names["Options"](meeting, max_events, False)
    told = n, inputs, options, out, state, plenty
    _, status = names["batch"](0, False, *told)
    if status == UNDECIDED:  # here the loop decides
        _, status = names["batch"](0, True, *told)
    tally, lists = state.tally[0], {"velocities": out.v[0], "collisions": out.hits[0]}
    lists |= {"impulses": out.p, "absorbed": out.a, "held": out.held}
    return SimpleNamespace(
        **{name: array.tolist() for name, array in lists.items()},
        **{name: getattr(tally, name) for name in ("events", "rounds", "margin")},
        **{"status": status, "collapsed": bool(out.collapsed[0]), "state": state},
        effort=plenty - tally.effort,
    )
