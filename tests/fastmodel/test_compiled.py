"""Compiled kernels behave as Python functions do."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

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


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timers here")
def test_exceptions_of_signal_handlers_come_out_of_a_kernel_as_they_are():
    """Without the guard about two of three of the signals end in a `SystemError`, while numba makes the results.

    The calls are in a process of their own: a signal inside the measurement of coverage would leave its lock taken.
    """
    run = subprocess.run(  # noqa: S603 -- our own script
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=120, check=False
    )
    assert run.stdout.split() == ["StopError"], run.stderr


#: Calls a kernel, and prints how often it was compiled.
TWICE = """
from fastmodel.compiled import compile_kernel


def double(value):
    return 2.0 * value


assert compile_kernel(double)(1.5) == 3.0
print(sum(compile_kernel(double).__wrapped__.stats.cache_misses.values()))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no locks of files")
def test_of_processes_that_start_together_one_compiles(tmp_path):
    (tmp_path / "twice.py").write_text(TWICE)
    command, environment = [sys.executable, "twice.py"], {**os.environ, "PYTHONPATH": str(ROOT)}
    runs = [
        subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)  # noqa: S603 -- ours
        for _ in range(2)
    ]
    assert sorted(run.communicate(timeout=120)[0].strip() for run in runs) == ["0", "1"]
