"""The command line, called inside the process of the tests."""

import re
import shlex

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
