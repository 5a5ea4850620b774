"""Recordings of simulated arrays keep every force of a frame, beside files of real sensors and of earlier versions."""

import dataclasses
import json

import mujoco
import numpy as np
import pytest

import fastmodel
from meshes import TexelArray
from validation.recordings import mcap_reader
from validation.recordings.importing import save
from validation.recordings.live_frames import replay_frames
from validation.recordings.mcap_writer import Clocks, RecordingWriter
from validation.recordings.recording import RecordingError, Setup, make_array

# The method `boxes` with a Gaussian is warned of; here its forces are only stored and read.
pytestmark = pytest.mark.filterwarnings("ignore::fastmodel.OptionWarning")

NAMES = ("texel_forces", "pressures", "net_force", "net_torque", "tangential")


@pytest.fixture(scope="module")
def frames():
    """Frames of a 3 x 4 array under a box that friction holds on it, by contact method."""
    found = {}
    wts = fastmodel.load("wts-0614-34")
    array = TexelArray.grid(4, 3, wts.array.pitch)
    parameters = dataclasses.replace(wts, array=array, tables={})
    for method in ("cover", "boxes"):
        spec = mujoco.MjSpec()
        fastmodel.recommend_options(spec)
        sensor = fastmodel.attach(spec, "world", parameters, contact=method, every=1)
        body = spec.worldbody.add_body(name="box", pos=[1e-3, 0, 4e-3])
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[4e-3, 4e-3, 4e-3], mass=0.3)
        model = spec.compile()
        data = mujoco.MjData(model)
        sensor.bind(model)
        data.xfrc_applied[model.body("box").id, 0] = 0.8
        for _ in range(40):
            mujoco.mj_step(model, data)
            if sensor.step(data):
                found.setdefault(method, []).append(sensor.frame())
    return found


@pytest.fixture
def path(tmp_path, frames):
    path = tmp_path / "simulated.mcap"
    with RecordingWriter(path, arrays=[make_array(4, 3), make_array(4, 3)], setup=Setup(source="test")) as writer:
        for cover, boxes in zip(frames["cover"], frames["boxes"], strict=True):
            writer.add_simulated_frame(0, Clocks(round(1e9 * cover.time)), cover)
            writer.add_simulated_frame(1, Clocks(round(1e9 * cover.time)), boxes)
    return path


def test_every_force_of_a_frame_is_replayed(path, frames):
    recording = mcap_reader.read(path)
    for number, made in enumerate(frames.values()):
        for frame, original in zip(replay_frames(recording, array=number), made, strict=True):
            np.testing.assert_array_equal(frame.counts, original.counts)
            for name in NAMES:
                np.testing.assert_array_equal(getattr(frame, name), getattr(original, name), err_msg=name)
            assert frame.tangential_source == original.tangential_source
        assert all(getattr(recording.arrays[number].simulated, name).any() for name in NAMES)
    sources = [array.simulated.tangential_source for array in recording.arrays]
    assert sources == ["net shear, shared in proportion to pressure", "contacts of each texel"]


def test_a_copy_and_a_recovered_file_keep_the_forces(path, tmp_path):
    recording = mcap_reader.read(path)
    save(recording, tmp_path / "copy.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-40])
    assert mcap_reader.recover(cut)
    for other in (tmp_path / "copy.mcap", cut):
        for array, copied in zip(recording.arrays, mcap_reader.read(other).arrays, strict=True):
            for name in NAMES:
                np.testing.assert_array_equal(getattr(copied.simulated, name), getattr(array.simulated, name))
            assert copied.simulated.tangential_source == array.simulated.tangential_source


def test_files_of_real_sensors_and_of_earlier_versions_stay_readable(tmp_path, softcover):
    real, earlier = tmp_path / "real.mcap", tmp_path / "earlier.mcap"
    for path, forces in ((real, None), (earlier, np.full(12, 0.5))):
        with RecordingWriter(path, arrays=[make_array(4, 3)], setup=Setup()) as writer:
            for number in range(3):
                writer.add_frame(0, Clocks(number * 10**9), np.full(12, number), texel_forces=forces)
    assert mcap_reader.read(real).arrays[0].simulated is None
    assert next(replay_frames(mcap_reader.read(real))).pressures is None
    kept = mcap_reader.read(earlier).arrays[0].simulated
    assert (kept.texel_forces == 0.5).all()
    assert np.isnan(kept.net_force).all()
    frame = next(replay_frames(mcap_reader.read(earlier)))
    assert frame.net_force is None
    np.testing.assert_allclose(frame.pressures, 0.5 / 3.4e-3**2)
    assert "texel forces only" in softcover("replay", earlier, "--speed", "0")[2]
    assert json.loads(softcover("replay", real, "--json")[1])["arrays"][0]["simulated"] is None


def test_replay_states_the_forces(path, frames, softcover):
    told = json.loads(softcover("replay", path, "--json")[1])["arrays"]
    for array, made in zip(told, frames.values(), strict=True):
        forces = array["simulated"]
        assert forces["largest_net_force_n"] == pytest.approx(max(np.linalg.norm(frame.net_force) for frame in made))
        assert forces["largest_shear_n"] == pytest.approx(max(np.hypot(*frame.net_force[:2]) for frame in made))
        assert forces["largest_pressure_pa"] == pytest.approx(max(frame.pressures.max() for frame in made))
        assert forces["tangential_source"] == made[0].tangential_source
    said = softcover("replay", path, "--speed", "0")[2]
    assert "array 0, simulated: net force up to" in said
    assert "shared in proportion to pressure" in said


def test_values_for_another_number_of_texels_are_refused(tmp_path, frames):
    path = tmp_path / "wrong.mcap"
    with RecordingWriter(path, arrays=[make_array(4, 3)], setup=Setup()) as writer:
        tangential = np.zeros((5, 2))
        writer.add_simulated_frame(0, Clocks(1), dataclasses.replace(frames["cover"][0], tangential=tangential))
    with pytest.raises(RecordingError, match=r"/tactile/tangential has 10 values, not 24"):
        mcap_reader.read(path)
