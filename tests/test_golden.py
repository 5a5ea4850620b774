"""Ten golden runs, as `benchmarks/golden.py` recorded them, from an empty store and from a warm one."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.slow
def test_ten_golden_runs_are_as_recorded():
    """Sums are rounded differently on other processors: 1e-6 of the largest number of an array."""
    command = [
        sys.executable,
        "benchmarks/golden.py",
        "compare",
        "tests/golden",
        "--tier",
        "ten",
        "--tolerance",
        "1e-6",
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("green") == 10
