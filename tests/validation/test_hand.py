import importlib.util
import json
import os
import subprocess
import sys
import time

import mujoco
import numpy as np
import pytest

from validation.recordings.importing import open_recording

needs_hand = pytest.mark.skipif(
    importlib.util.find_spec("gymnasium_robotics") is None,
    reason="the hand is not installed: python -m pip install 'softcover[hand]'",
)


@pytest.fixture(scope="module")
def parameters(wts_derivation):
    return wts_derivation.parameters


@pytest.fixture
def hand(parameters):
    from validation.hand import Hand

    return Hand(parameters)


def axes(hand, geom):
    return hand.data.geom(geom).xmat.reshape(3, 3)


def pressed(hand, name):
    """What MuJoCo says that presses on an array: bodies that pull by friction on its edge do not count [N]."""
    plate = hand.model.geom(f"{name}/plate").id
    normal, by_body, force = axes(hand, plate)[:, 2], {}, np.zeros(6)
    for index, contact in enumerate(hand.data.contact):
        if plate in contact.geom:
            mujoco.mj_contactForce(hand.model, hand.data, index, force)
            side = list(contact.geom).index(plate)
            other = hand.model.geom_bodyid[contact.geom[1 - side]]
            onto = contact.frame.reshape(3, 3).T @ force[:3] * (1 if side else -1)
            by_body[other] = by_body.get(other, 0.0) - onto @ normal
    return sum(max(total, 0.0) for total in by_body.values())


@needs_hand
def test_132_texels_look_out_of_the_palm(hand):
    from validation.hand import PLACES

    assert sum(sensor.parameters.array.count for sensor in hand.sensors.values()) == 132
    assert [place.body for place in PLACES] == list(hand.sensors)
    mujoco.mj_forward(hand.model, hand.data)
    for finger in ("ff", "mf", "rf", "lf"):
        for link, following in (("proximal", "J2"), ("middle", "J1")):
            plate = hand.data.geom(f"{finger}{link}/plate")
            frame = plate.xmat.reshape(3, 3).copy()
            tip = hand.data.body(f"robot0:{finger}distal")
            along = tip.xpos - hand.data.body(f"robot0:{finger}{link}").xpos
            assert frame[:, 1] @ along > 0.9 * np.linalg.norm(along)
            # closing the finger moves its tip to the side to which the texels look
            before = tip.xpos + tip.xmat.reshape(3, 3)[:, 2] * 0.02
            hand.data.joint(f"robot0:{finger.upper()}{following}").qpos[0] += 0.1
            mujoco.mj_forward(hand.model, hand.data)
            assert frame[:, 2] @ (tip.xpos + tip.xmat.reshape(3, 3)[:, 2] * 0.02 - before) > 1e-3
    palm, knuckle = hand.data.geom("palm/plate"), hand.data.body("robot0:mfknuckle")
    assert axes(hand, "palm/plate")[:, 1] @ (knuckle.xpos - palm.xpos) > 0.03
    assert axes(hand, "palm/plate")[2, 2] > 0.9


@needs_hand
def test_arrays_feel_what_mujoco_says_that_presses_on_them(hand):
    felt, told = [], []
    for _ in hand.run(1.7):
        felt.append([sensor.carried() for sensor in hand.sensors.values()])
        told.append([pressed(hand, name) for name in hand.sensors])
        for sensor in hand.sensors.values():
            assert 0.0 <= sensor.contact_forces().sum() <= sensor.carried() * (1 + 1e-9)
    np.testing.assert_allclose(felt, told, atol=1e-6 * np.max(told))
    assert (np.max(felt, axis=0) > 0.5).all()


def test_without_the_hand_one_line_says_what_to_install(softcover, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "gymnasium_robotics", None)
    monkeypatch.setenv("MUJOCO_GL", "egl")
    status, out, err = softcover("hand")
    assert (status, out) == (3, "")
    wanted = "gymnasium_robotics is not installed; run: python -m pip install 'softcover[hand]'"
    assert err.splitlines() == [f"softcover: {wanted}"]
    assert list(tmp_path.iterdir()) == []


@needs_hand
@pytest.mark.slow
def test_the_grip_is_held_upside_down(hand):
    for _ in hand.run():
        pass
    palm, grip = hand.data.body("robot0:palm"), hand.data.body("grip")
    assert axes(hand, "palm/plate")[2, 2] < -0.9
    # below the palm, and not on its way down
    assert 0.03 < palm.xpos[2] - grip.xpos[2] < 0.07
    assert np.abs(hand.data.joint("grip").qvel[:3]).max() < 0.01
    assert sum(sensor.carried() for sensor in hand.sensors.values()) > 2.0


@needs_hand
@pytest.mark.slow
def test_the_grasp_is_faster_than_real_time(parameters):
    from validation.hand import Hand

    taken = []
    # the first run may still compile; a busy machine may slow one of the others down
    for _ in range(4):
        hand, start = Hand(parameters), time.thread_time()
        for _ in hand.run(2.0):
            pass
        taken.append(time.thread_time() - start)
    assert min(taken) < 2.0


@needs_hand
@pytest.mark.slow
def test_everything_is_recorded_and_drawn(tmp_path):
    from matplotlib.image import imread

    words = ["hand", "--out", "out", "--method", "boxes", "--json"]
    done = subprocess.run(  # noqa: S603 -- our own code
        [sys.executable, "-c", "from validation.cli import main; main()", *words],
        cwd=tmp_path,
        env={key: value for key, value in os.environ.items() if key != "MUJOCO_GL"},
        capture_output=True,
        text=True,
        check=True,
    )
    result = json.loads(done.stdout)
    assert result["texels"] == 132
    recording = open_recording(tmp_path / "out" / "hand.mcap")
    assert recording.complete
    assert len(recording.times) == result["frames"] == 400
    np.testing.assert_allclose(np.diff(recording.times), 0.01, atol=1e-6)
    assert [array.texels.name for array in recording.arrays] == list(result["largest_force"])
    assert sum(array.texels.count for array in recording.arrays) == 132
    assert max(array.counts.max() for array in recording.arrays) > 0
    picture = imread(tmp_path / "out" / "hand.png")
    assert picture.shape[1] == 1100
    # taller where the scene itself could be rendered, and then the grip's colour is in it
    if picture.shape[0] == 900:
        red, green, blue = np.moveaxis(picture[:400, :, :3], -1, 0)
        assert ((red > 2 * blue) & (red > 1.3 * green)).any()
    else:
        assert "no OpenGL" in done.stderr
