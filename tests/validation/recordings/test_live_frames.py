"""Frames of a sensor, of a recording and of a simulation are of one type."""

import re
import subprocess
import sys
from itertools import islice
from pathlib import Path

import numpy as np

import fastmodel
from meshes import Sphere, TexelArray
from validation.recordings.live_frames import simulate_frames, stream_frames
from validation.weiss.sensor import Sensor
from validation.weiss.virtual import show_frames

PARAMETERS = fastmodel.Parameters(
    array=TexelArray.grid(14, 6, 3.4e-3),
    spread=fastmodel.Gaussian(sigma_x=0.6, sigma_y=0.6, ksize_x=5, ksize_y=5),
    electronics=fastmodel.WTS_0614_34,
)


def test_simulated_frames_arrive_unchanged_over_a_port(plug_in):
    simulated = list(islice(simulate_frames(PARAMETERS, Sphere(radius=8e-3), load=6.0), 20, 60))
    assert max(frame.counts.max() for frame in simulated) > 500
    with Sensor(plug_in(show_frames(frame.counts for frame in simulated)).name) as sensor:
        received = list(islice(stream_frames(sensor), 35))
    assert {type(frame) for frame in received} == {type(frame) for frame in simulated} == {fastmodel.Frame}
    for mine, theirs in zip(received, simulated[1:], strict=False):
        assert np.array_equal(mine.counts, theirs.counts)
    assert received[20].image.shape == (14, 6)
    assert received[20].image.max() == round(255 * received[20].counts.max() / 4095)


def test_the_documented_program_reads_the_frames_of_a_sensor(plug_in):
    page = (Path(__file__).parents[3] / "docs" / "real-sensor.md").read_text()
    (program,) = re.findall(r"^```python\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE)
    program = f"port = {plug_in().name!r}\n{program}"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)  # noqa: S603
    assert run.returncode == 0, run.stderr
