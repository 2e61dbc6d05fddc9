"""The command line, called inside the process of the tests."""

import re
import shlex

import fit_example
import numpy as np
from click.testing import CliRunner

from cradle.command.solve import main
from cradle.runtime import compile as runtime


def call(line, expected=0):
    # What a command chooses for its own process must not reach the next one.
    free = {runtime.VARIABLE: None}
    result = CliRunner(env=free).invoke(main, shlex.split(line), catch_exceptions=False)
    assert result.exit_code == expected, result.output
    return result.stdout


def examples():
    """Every example of the help."""
    found = []
    for name in main.commands:
        lines = re.findall(r"^\s+cradle (.+)$", call(f"{name} --help"), flags=re.M)
        assert lines or name in ("template", "warm-up"), name  # these take no options
        found += lines
    return found


def film_of_lifted(balls, lifted):
    """A film of equal balls, as a tracker writes it: the first ones strike, as many leave."""
    times = (np.arange(81) - 40.3) / 240
    before, after = (fit_example.swing(0.7, times) * some for some in (times < 0, times > 0))
    ways = [before * (k < lifted) + after * (k >= balls - lifted) for k in range(balls)]
    places = np.array(ways) + 0.022 * np.arange(balls)[:, None]
    places += np.random.default_rng(1).normal(0, 1e-4, places.shape)
    rows = np.column_stack([times, *places])
    head = "\t".join(["t", *(f"{name}/x" for name in "ABCDE"[:balls])])
    return "\n".join([head, *("\t".join(f"{x:.7f}" for x in row) for row in rows)])
