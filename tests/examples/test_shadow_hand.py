"""The Shadow hand example runs as documented, and its arrays measure what MuJoCo says presses on them."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.support.shadow_hand import NEEDS_HAND
from validation.recordings.importing import open_recording

EXAMPLE = Path(__file__).parents[2] / "examples" / "shadow_hand.py"
pytestmark = NEEDS_HAND


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("shadow_hand", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        # Dataclasses look their module up by name.
        patch.setitem(sys.modules, spec.name, module)
        spec.loader.exec_module(module)
        yield module


@pytest.fixture
def hand(example, wts_derivation):
    return example.Hand(wts_derivation.parameters)


def get_axes(hand, geom):
    return hand.data.geom(geom).xmat.reshape(3, 3)


def sum_plate_forces(hand, name):
    """Force that presses on an array, from MuJoCo's contacts; bodies that pull at its edge do not count [N]."""
    plate = hand.model.geom(f"{name}/plate").id
    normal, by_body, force = get_axes(hand, plate)[:, 2], {}, np.zeros(6)
    for index, contact in enumerate(hand.data.contact):
        if plate in contact.geom:
            mujoco.mj_contactForce(hand.model, hand.data, index, force)
            side = list(contact.geom).index(plate)
            other = hand.model.geom_bodyid[contact.geom[1 - side]]
            onto = contact.frame.reshape(3, 3).T @ force[:3] * (1 if side else -1)
            by_body[other] = by_body.get(other, 0.0) - onto @ normal
    return sum(max(total, 0.0) for total in by_body.values())


def test_132_texels_face_out_of_the_palm(example, hand):
    assert sum(sensor.parameters.array.count for sensor in hand.sensors.values()) == 132
    assert [mount.link for mount in example.MOUNTS] == list(hand.sensors)
    mujoco.mj_forward(hand.model, hand.data)
    for finger in ("ff", "mf", "rf", "lf"):
        for link, following in (("proximal", "J2"), ("middle", "J1")):
            plate = hand.data.geom(f"{finger}{link}/plate")
            frame = plate.xmat.reshape(3, 3).copy()
            tip = hand.data.body(f"robot0:{finger}distal")
            along = tip.xpos - hand.data.body(f"robot0:{finger}{link}").xpos
            assert frame[:, 1] @ along > 0.9 * np.linalg.norm(along)
            # Closing the finger moves its tip to the side that the texels face.
            before = tip.xpos + tip.xmat.reshape(3, 3)[:, 2] * 0.02
            hand.data.joint(f"robot0:{finger.upper()}{following}").qpos[0] += 0.1
            mujoco.mj_forward(hand.model, hand.data)
            assert frame[:, 2] @ (tip.xpos + tip.xmat.reshape(3, 3)[:, 2] * 0.02 - before) > 1e-3
    palm, knuckle = hand.data.geom("palm/plate"), hand.data.body("robot0:mfknuckle")
    assert get_axes(hand, "palm/plate")[:, 1] @ (knuckle.xpos - palm.xpos) > 0.03
    assert get_axes(hand, "palm/plate")[2, 2] > 0.9


def test_arrays_measure_the_forces_that_mujoco_reports_on_their_plates(hand):
    measured, reported = [], []
    for _ in hand.run(1.7):
        measured.append([sensor.carried() for sensor in hand.sensors.values()])
        reported.append([sum_plate_forces(hand, name) for name in hand.sensors])
        for sensor in hand.sensors.values():
            assert 0.0 <= sensor.contact_forces().sum() <= sensor.carried() * (1 + 1e-9)
    np.testing.assert_allclose(measured, reported, atol=1e-6 * np.max(reported))
    assert (np.max(measured, axis=0) > 0.5).all()


def test_the_grip_is_held_upside_down(hand):
    for _ in hand.run():
        pass
    palm, grip = hand.data.body("robot0:palm"), hand.data.body("grip")
    assert get_axes(hand, "palm/plate")[2, 2] < -0.9
    # The grip is below the palm and does not fall.
    assert 0.03 < palm.xpos[2] - grip.xpos[2] < 0.07
    assert np.abs(hand.data.joint("grip").qvel[:3]).max() < 0.01
    assert sum(sensor.carried() for sensor in hand.sensors.values()) > 2.0


def test_the_example_records_and_draws_as_documented(example, tmp_path):
    from matplotlib.image import imread

    command = [sys.executable, EXAMPLE, "--out", "out", "--method", "boxes"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)  # noqa: S603 -- ours
    assert "132 texels, 400 frames" in done.stdout
    largest = re.findall(r"^largest force on (\w+): ([\d.]+) N$", done.stdout, flags=re.MULTILINE)
    assert [name for name, _ in largest] == [mount.link for mount in example.MOUNTS]
    assert any(float(force) > 1.0 for _, force in largest)
    recording = open_recording(tmp_path / "out" / "hand.mcap")
    assert recording.complete
    assert len(recording.times) == 400
    np.testing.assert_allclose(np.diff(recording.times), 0.01, atol=1e-6)
    assert [array.texels.name for array in recording.arrays] == [name for name, _ in largest]
    assert max(array.counts.max() for array in recording.arrays) > 0
    picture = imread(tmp_path / "out" / "hand.png")
    assert picture.shape[1] == 1100
    # The picture is taller if the scene could be rendered; then it contains the colour of the grip.
    if picture.shape[0] == 900:
        red, green, blue = np.moveaxis(picture[:400, :, :3], -1, 0)
        assert ((red > 2 * blue) & (red > 1.3 * green)).any()
    else:
        assert "no OpenGL" in done.stdout
