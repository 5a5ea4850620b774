"""The example with MuJoCo Warp gives texel forces of every world that carry what presses on the array."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "warp_worlds.py"


@pytest.mark.slow
def test_every_world_carries_weight_and_push():
    pytest.importorskip("mujoco_warp", reason="MuJoCo Warp is not installed: python -m pip install mujoco-warp")
    spec = importlib.util.spec_from_file_location("warp_worlds", EXAMPLE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    found, images = example.run(3, 300)
    expected = 0.1 * 9.81 + np.linspace(1, example.PUSH, 3)
    np.testing.assert_allclose(found.load, expected, rtol=1e-3)
    np.testing.assert_allclose(found.cell_forces.sum(axis=(1, 2)), expected, rtol=1e-3)
    np.testing.assert_allclose(found.texel_forces.sum(axis=1), expected, rtol=0.02)
    middle = found.texel_forces.reshape(3, 14, 6)[:, 6:8, 2:4]  # the ball lies over the corner of four texels
    assert (found.texel_forces.max(axis=1) == middle.max(axis=(1, 2))).all()
    assert np.ptp(middle, axis=(1, 2)).max() < 0.01 * expected.max()
    assert (np.diff(images.max(axis=(1, 2)).astype(int)) >= 0).all()
    assert images.any()
