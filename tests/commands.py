"""The command line, called inside the process of the tests."""

import re
import shlex

import numpy as np
from click.testing import CliRunner

from cradle import Chain, ImpulseCorrelation, Pendulums, swing
from cradle.command.solve import main
from cradle.runtime import compile as runtime


def call(line, expected=0):
    # What a command chooses for its own process must not reach the next one.
    free = {runtime.VARIABLE: None}
    result = CliRunner(env=free).invoke(main, shlex.split(line), catch_exceptions=False)
    assert result.exit_code == expected, result.output
    return result.stdout


def swing_film(times, slower=1, unit=1.0):
    """A film of two unlike balls, period 0.9 s, as Kinovea exports it; two marks are missing."""
    hanging = Pendulums(9.81 * (0.45 / np.pi) ** 2, gaps=1e-4)
    run = swing(Chain([1, 2], [0, 0], 0.95), ImpulseCorrelation(0), [-0.03, 0], times,
                pendulums=hanging)  # fmt: skip
    marks = [[f"{x / unit:.7g}" for x in row] for row in np.add(run.positions, [0.5, 0.53])]
    marks[20][1] = marks[31][0] = ""
    lines = [f"{slower * t:.6g}\t{a}\t{b}" for t, (a, b) in zip(times, marks, strict=True)]
    return "\n".join(["t\tA/x\tB/x", *lines])


def examples():
    """Every example of the help."""
    found = []
    for name in main.commands:
        lines = re.findall(r"^\s+cradle (.+)$", call(f"{name} --help"), flags=re.M)
        assert lines or name in ("template", "warm-up"), name  # these take no options
        found += lines
    return found
