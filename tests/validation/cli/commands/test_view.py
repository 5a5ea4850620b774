import json
import os
import pty
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from meshes.catalogue import ARRAYS
from validation.render.image import Scale

ARRAY = ARRAYS["wts-0614-34"]
TOUCH = ("--indenter", "sphere:radius=5mm", "--load", "500g")
WEIGHT = 0.5 * 9.80665


def test_view_prints_the_last_frame_as_json(softcover):
    status, out, _ = softcover("view", "wts-0614-34", *TOUCH, "--seconds", "1", "--json")
    result = json.loads(out)
    assert status == 0
    assert np.shape(result["image"]) == np.shape(result["counts"]) == np.shape(result["texel_forces"]) == (14, 6)
    assert result["carried"] == pytest.approx(WEIGHT, rel=0.01)
    assert np.sum(result["texel_forces"]) + result["outside"] == pytest.approx(result["carried"], rel=0.01)
    assert result["net_force"] == pytest.approx([0, 0, -result["carried"]], abs=1e-6)
    np.testing.assert_allclose(result["pressures"], np.array(result["texel_forces"]) / 3.4e-3**2)
    assert np.shape(result["tangential"]) == (14, 6, 2)
    assert "shared" in result["tangential_source"]
    peak = np.unravel_index(np.argmax(result["texel_forces"]), (14, 6))
    assert peak[0] in {6, 7}
    assert peak[1] in {2, 3}


@pytest.mark.parametrize(
    ("words", "display", "expected"),
    [
        (["--display", "windw"], ":0", "--display: unknown place 'windw'; did you mean 'window'?"),
        (["--display", "window"], "", "--display: no window can be opened (there is no display"),
        (["--display", "window"], ":31999", "--display: no window can be opened (X11: Failed to open display :31999)"),
    ],
)
def test_a_window_that_cannot_be_opened_is_refused_with_the_reason(softcover, monkeypatch, words, display, expected):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    status, out, err = softcover("view", "wts-0614-34", *TOUCH, *words)
    assert (status, out) == (2, "")
    assert err.startswith(f"softcover: {expected}")
    assert err.count("\n") == 1


@pytest.fixture
def display():
    """A display of its own, in memory.

    It does not reset itself when the last client leaves: while it does, it refuses new ones.
    """
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("Xvfb is not installed: apt install xvfb")
    command = [program, "-displayfd", "1", "-screen", "0", "900x700x24", "-nolisten", "tcp", "-noreset"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:  # noqa: S603
        yield f":{server.stdout.readline().strip()}"
        server.terminate()


@pytest.mark.slow
def test_the_window_shows_the_array_and_its_image(display):
    from PIL import ImageGrab

    code = "from validation.cli import main; main()"
    words = ("view", "wts-0614-34", *TOUCH, "--display", "window", "--json")
    running = subprocess.Popen(  # noqa: S603 -- our own code
        [sys.executable, "-c", code, *words],
        env={**os.environ, "DISPLAY": display},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    seen, deadline = False, time.monotonic() + 120
    while not seen and running.poll() is None and time.monotonic() < deadline:
        time.sleep(0.5)
        picture = np.asarray(ImageGrab.grab(xdisplay=display)).astype(int)
        # the image in the corner, bright where the sphere presses, and in the colour of zero where nothing does
        corner = picture[260:680, 10:190]
        seen = (corner[..., 1] > 200).any() and (corner == Scale(peak=1).rgb(0)).all(axis=-1).any()
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert (seen, running.returncode) == (True, 0), err
    assert 0.1 * WEIGHT < json.loads(out)["carried"] < 1.01 * WEIGHT


def drain(terminal):
    """Read what comes until nobody writes any more: a program whose terminal is full waits for ever."""
    try:
        while os.read(terminal, 65536):
            pass
    except OSError:
        pass


@pytest.mark.slow
def test_on_a_terminal_view_runs_until_ctrl_c_and_exits_with_0():
    master, slave = pty.openpty()
    code = "from validation.cli import main; main()"
    command = [sys.executable, "-c", code, "view", "wts-0614-34", *TOUCH]
    headless = {key: value for key, value in os.environ.items() if key not in {"DISPLAY", "WAYLAND_DISPLAY"}}
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=slave, env=headless)  # noqa: S603 -- our own code
    os.close(slave)
    seen, deadline = b"", time.monotonic() + 60
    while b"4.90 N at" not in seen and time.monotonic() < deadline:
        seen += os.read(master, 65536)
    running.send_signal(signal.SIGINT)
    reader = threading.Thread(target=drain, args=(master,))
    reader.start()
    out, _ = running.communicate(timeout=30)
    reader.join()
    os.close(master)
    assert b"4.90 N at" in seen
    assert b"\x1b[" in seen
    assert running.returncode == 0
    assert b"fast model, mN" in out
