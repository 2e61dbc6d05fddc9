"""What a test of compiled code needs."""

import pytest

from cradle.runtime import compile as runtime

needs_numba = pytest.mark.skipif(not runtime.available(), reason="numba is not installed")
#: The kernel as it stands, and compiled.
runtimes = pytest.mark.parametrize("on", [True, pytest.param(False, marks=needs_numba)])
