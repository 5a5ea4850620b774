"""Compiled kernels behave as Python functions do."""

import signal
import subprocess
import sys

import pytest

#: Calls a kernel until a signal comes, 100 times, and prints the names of the exceptions that came out.
SCRIPT = """
import signal

import numpy as np

from fastmodel.compiled import compile_kernel


class StopError(Exception):
    pass


def split(values):
    return values + 1.0, values + 2.0, 3.0


def interrupt(*_):
    raise StopError


def call_until_signal(seconds):
    signal.setitimer(signal.ITIMER_REAL, seconds)
    while True:
        kernel(values)


kernel, values = compile_kernel(split), np.zeros(3)
assert [np.sum(part) for part in kernel(values)] == [3.0, 6.0, 3.0]
signal.signal(signal.SIGALRM, interrupt)
raised = set()
for number in range(100):
    try:
        call_until_signal(2e-5 + 2e-8 * number)
    except BaseException as error:
        raised.add(type(error).__name__)
print(*sorted(raised))
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timers here")
def test_exceptions_of_signal_handlers_come_out_of_a_kernel_as_they_are():
    """Without the guard about two of three of the signals end in a `SystemError`, while numba makes the results.

    The calls are in a process of their own: a signal inside the measurement of coverage would leave its lock taken.
    """
    run = subprocess.run(  # noqa: S603 -- our own script
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=120, check=False
    )
    assert run.stdout.split() == ["StopError"], run.stderr
