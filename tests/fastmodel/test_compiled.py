"""Compiled kernels behave as Python functions do."""

import signal

import numpy as np
import pytest

from fastmodel.compiled import compile_kernel


class StopError(Exception):
    """An exception that only a signal handler of the test raises."""


def split(values):
    return values + 1.0, values + 2.0, 3.0


def call_until_signal(kernel, values, seconds):
    signal.setitimer(signal.ITIMER_REAL, seconds)
    while True:
        kernel(values)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timers here")
@pytest.mark.parametrize("error", [KeyboardInterrupt, StopError])
def test_exceptions_of_signal_handlers_come_out_of_a_kernel_as_they_are(error):
    """Without the guard about two of three of the signals end in a `SystemError`, while numba makes the results."""

    def interrupt(*_):
        raise error

    kernel, values = compile_kernel(split), np.zeros(3)
    assert [np.sum(part) for part in kernel(values)] == [3.0, 6.0, 3.0]
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        for number in range(200):
            with pytest.raises(error):
                call_until_signal(kernel, values, 2e-5 + 1e-8 * number)
    finally:
        signal.signal(signal.SIGALRM, before)
