"""Which window VTK draws with, and which files are written where it can and cannot draw."""

import logging
import os

import numpy as np
import pytest

from tests.support.drawn_views import CORNERS
from validation.scene import draw, rendering
from validation.scene.cover_scene import CoverScene

CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
EGL, MESA = "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"


@pytest.fixture
def machine(monkeypatch):
    """A machine with some libraries, where drawing by some windows fails for a reason."""

    def make(libraries, faults, platform="linux"):
        tried = []

        def draw_by(window):
            tried.append(window)
            return faults.get(window)

        monkeypatch.setattr(rendering.sys, "platform", platform)
        monkeypatch.setattr(rendering, "_is_library", libraries.__contains__)
        monkeypatch.setattr(rendering, "_try_to_draw", draw_by)
        rendering.find_window_without_display.cache_clear()
        return tried

    yield make
    monkeypatch.undo()
    rendering.find_window_without_display.cache_clear()


@pytest.mark.parametrize(
    ("libraries", "faults", "window", "tried"),
    [
        ({"libEGL.so.1"}, {}, EGL, [EGL]), ({"libEGL.so", "libOSMesa.so"}, {EGL: "x"}, MESA, [EGL, MESA]),
        ({"libOSMesa.so.6"}, {}, MESA, [MESA]), ({"libEGL.so.1", "libOSMesa.so.8"}, {}, EGL, [EGL]),
    ],
)  # fmt: skip
def test_the_first_library_that_draws_is_taken(machine, libraries, faults, window, tried):
    found = machine(libraries, faults)
    assert rendering.find_window_without_display() == window
    assert rendering.find_window_without_display() == window
    assert found == tried  # once per process


@pytest.mark.parametrize(
    ("libraries", "faults", "platform", "said"),
    [
        ((), {}, "linux", "neither EGL nor OSMesa is installed"),
        (("libEGL.so", "libOSMesa.so"), {EGL: "no driver", MESA: "black"}, "linux",
         f"VTK cannot draw here ({EGL}: no driver; {MESA}: black)"),
        (("libEGL.so",), {"": "no window"}, "darwin", "VTK cannot draw on this machine (no window)"),
    ],
)  # fmt: skip
def test_a_machine_that_cannot_draw_says_why(machine, libraries, faults, platform, said):
    machine(libraries, faults, platform)
    with pytest.raises(rendering.RenderingError) as caught:
        rendering.find_window_without_display()
    assert str(caught.value).startswith(said)


def test_other_systems_need_no_choice(machine):
    tried = machine((), {}, "win32")
    assert rendering.find_window_without_display() == ""
    assert tried == [""]


def test_a_library_is_one_that_loads():
    assert rendering._is_library("libc.so.6")
    assert not rendering._is_library("libNone.so.1")


@pytest.mark.parametrize("window", ["", "a window"])
def test_the_trial_picture_is_drawn_by_the_window_that_is_tried(monkeypatch, window):
    monkeypatch.setattr(rendering, "_PROBE", f"import os, sys; sys.exit('by ' + os.environ.get('{CHOICE}', 'none'))")
    monkeypatch.delenv(CHOICE, raising=False)
    assert rendering._try_to_draw(window) == f"by {window or 'none'}"


@pytest.mark.parametrize("window", ["", EGL])
@pytest.mark.parametrize("before", [None, "mine"])
@pytest.mark.parametrize("fails", [False, True])
def test_the_choice_of_a_window_lasts_as_long_as_the_plotter(monkeypatch, window, before, fails):
    pyvista = pytest.importorskip("pyvista")
    made = []

    class Plotter:
        closed = False

        def __init__(self, **options):
            self.options = options
            made.append(self)

        def close(self):
            self.closed = True

    def use():
        with rendering.open_plotter(shape=(1, 2)) as plotter:
            assert plotter.options == {"off_screen": True, "shape": (1, 2)}
            assert os.environ.get(CHOICE) == (window or before)
            assert not plotter.closed
            if fails:
                raise KeyError

    monkeypatch.setattr(pyvista, "Plotter", Plotter)
    monkeypatch.setattr(rendering, "find_window_without_display", lambda: window)
    if before is None:
        monkeypatch.delenv(CHOICE, raising=False)
    else:
        monkeypatch.setenv(CHOICE, before)
    if fails:
        with pytest.raises(KeyError):
            use()
    else:
        use()
    assert made[0].closed
    assert os.environ.get(CHOICE) == before


@pytest.fixture
def block():
    return CoverScene(position=2e-3 * CORNERS, displacement=1e-4 * CORNERS, cells=np.arange(8)[None], thickness=2e-3,
                      surface=np.arange(8.0), layer=np.array([0]))  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [
        (None, ("cover.png", "cover.gltf", "cover.vtu"), []),
        (rendering.RenderingError("no driver"), ("cover.vtu",), ["no cover.png: no driver"]),
        (ImportError("no pyvista"), (), ["pip install"]),
    ],
)
def test_the_files_of_a_cover_are_those_that_could_be_written(monkeypatch, tmp_path, caplog, block, case):
    """The case: what fails, the names of the files, and what is said."""
    pyvista = pytest.importorskip("pyvista")
    (fault, names, said), written = case, []

    def write(scene, path):
        if fault:
            raise fault
        assert scene is block
        written.append(path.name)

    monkeypatch.setattr(draw, "write_picture", write)
    monkeypatch.setattr(draw, "write_gltf", write)
    with caplog.at_level(logging.WARNING):
        assert draw.write_scene(block, tmp_path) == names
    assert written == ([] if fault else ["cover.png", "cover.gltf"])
    assert len(caplog.records) == len(said)
    assert all(words in record.getMessage() for words, record in zip(said, caplog.records, strict=True))
    grid = pyvista.read(tmp_path / "cover.vtu")
    assert grid.bounds == pytest.approx((0, 2e-3, 0, 2e-3, 0, 2e-3))
    np.testing.assert_allclose(grid.point_data["surface"], np.arange(8))
    np.testing.assert_allclose(grid.point_data["displacement"], block.displacement)
    assert draw.lacks_picture(names) == (names == ("cover.vtu",))


def test_no_scene_makes_no_file(tmp_path):
    assert draw.write_scene(None, tmp_path) == ()
    assert list(tmp_path.iterdir()) == []
    assert not draw.lacks_picture(())
