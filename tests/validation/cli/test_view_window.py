"""What the window is given to draw, by a viewer that writes it down: opening a real one needs a display."""

import contextlib
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
from validation.cli import view_window


class Viewer:
    """Writes down what is shown at each `sync`."""

    def __init__(self, *_scene, **_panels):
        self.cam, self.shown, self.now, self.closed = SimpleNamespace(), [], {}, False

    def lock(self):
        return contextlib.nullcontext()

    def set_images(self, image):
        self.now["image"] = image

    def set_texts(self, text):
        self.now["text"] = text

    def sync(self):
        self.shown.append(dict(self.now))

    def is_running(self):
        return not self.closed

    def close(self):
        self.closed = True


def test_each_image_is_drawn_with_its_text_and_then_time_is_left_to_the_simulation(monkeypatch):
    drawn, clock = Viewer(), SimpleNamespace(now=100.0)
    monkeypatch.setattr("mujoco.viewer.launch_passive", lambda *_, **__: drawn)
    monkeypatch.setattr(view_window, "time", SimpleNamespace(monotonic=lambda: clock.now))
    parameters = fastmodel.load("wts-0614-34")
    scene = SimpleNamespace(model=None, data=None, sensor=SimpleNamespace(parameters=parameters))
    counts = np.zeros(84, dtype=int)
    counts[8] = parameters.electronics.output_max
    with view_window.Window(scene) as window:
        assert window.is_open
        window.show(counts, " 5 N ")
        ((rectangle, image),) = [each["image"] for each in drawn.shown]
        assert drawn.shown[0]["text"][2:] == ("5 N", "")
        assert (rectangle.width, rectangle.height) == (image.shape[1], image.shape[0])
        assert image.shape[0] * 6 == image.shape[1] * 14
        others = (image != image[0, 0]).any(axis=2)  # texel [1, 2], the upper row first
        row, column = np.argwhere(others).mean(axis=0) / image.shape[0] * 14
        assert (row, column) == pytest.approx((12.5, 2.5), abs=0.1)
        assert not window.is_due
        clock.now += 10
        assert window.is_due
    assert drawn.closed
