import json
import os
import pty
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Foundation, Gaussian, Parameters
from meshes import Sphere
from meshes.catalogue import ARRAYS
from validation.sliding import Sliding

ARRAY = ARRAYS["wts-0614-34"]
TOUCH = ("--indenter", "sphere:radius=5mm", "--load", "500g")
WEIGHT = 0.5 * 9.80665


def test_the_indenter_comes_down_gently_and_its_weight_goes_round():
    parameters = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.6), electronics=WTS_0614_34)
    scene = Sliding(parameters, Sphere(radius=5e-3), load=WEIGHT, method=Foundation(modulus=1e9))
    carried, places, centres = [], [], []
    for moment in scene.run(6.0):
        frame = scene.sensor.frame()
        carried.append(scene.sensor.carried())
        if moment > 2.0:
            places.append(scene.place)
            centres.append(frame.texel_forces @ ARRAY.centres[:, :2] / frame.texel_forces.sum())
    assert carried[0] == 0.0
    assert max(carried) < 1.01 * WEIGHT
    np.testing.assert_allclose(carried[-len(places) :], WEIGHT, rtol=1e-3)
    radius = np.hypot(*np.transpose(places))
    np.testing.assert_allclose(radius, 0.2 * 6 * 3.4e-3, rtol=0.02)
    assert np.ptp(np.transpose(places), axis=1) == pytest.approx(2 * radius[:2].mean(), rel=0.02)
    assert np.abs(np.subtract(centres, places)).max() < 0.5e-3


def test_view_without_a_terminal_prints_the_last_image(softcover):
    status, out, _ = softcover("view", "wts-0614-34", *TOUCH, "--seconds", "1.5")
    assert status == 0
    assert "sphere:radius=5mm on wts-0614-34, 4.903 N" in out
    assert "fast model, mN" in out
    assert "4.90 N at (" in out
    assert "\x1b" not in out


def test_view_as_json(softcover):
    status, out, _ = softcover("view", "wts-0614-34", *TOUCH, "--seconds", "1", "--json")
    result = json.loads(out)
    assert status == 0
    assert np.shape(result["image"]) == np.shape(result["counts"]) == np.shape(result["texel_forces"]) == (14, 6)
    assert result["carried"] == pytest.approx(WEIGHT, rel=0.01)
    assert np.sum(result["texel_forces"]) + result["outside"] == pytest.approx(result["carried"], rel=0.01)
    peak = np.unravel_index(np.argmax(result["texel_forces"]), (14, 6))
    assert peak[0] in {6, 7}
    assert peak[1] in {2, 3}


def test_every_fault_is_told_at_once(softcover):
    status, out, err = softcover(
        "view", "wts-0614-3", "--indenter", "shpere", "--load", "0N", "--method", "boxs", "--seconds=-1"
    )
    assert (status, out) == (2, "")
    for part in ("'wts-0614-34'", "'sphere'", "--load: must be positive", "'boxes'", "--seconds: accepted: 0 or more"):
        assert part in err


def test_the_methods_are_those_of_the_fast_model():
    from validation.cli.view import _METHODS

    assert set(_METHODS) == {"default", *fastmodel.METHODS}


def test_on_a_terminal_it_is_live_until_interrupted_and_leaves_with_0():
    master, slave = pty.openpty()
    code = "from validation.cli import main; main()"
    command = [sys.executable, "-c", code, "view", "wts-0614-34", *TOUCH]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=slave)  # noqa: S603 -- our own code
    os.close(slave)
    seen, deadline = b"", time.monotonic() + 60
    while b"4.90 N at" not in seen and time.monotonic() < deadline:
        seen += os.read(master, 65536)
    running.send_signal(signal.SIGINT)
    out, _ = running.communicate(timeout=30)
    os.close(master)
    assert b"4.90 N at" in seen
    assert b"\x1b[" in seen
    assert running.returncode == 0
    assert b"fast model, mN" in out
