import numpy as np
import pytest

from fastmodel import WTS_0614_34, Foundation, Gaussian, Parameters
from meshes import Sphere
from meshes.catalogue import ARRAYS
from validation.cli.view_scene import Scene

ARRAY = ARRAYS["wts-0614-34"]
WEIGHT = 0.5 * 9.80665


@pytest.mark.slow
def test_the_indenter_comes_down_gently_and_carries_its_weight_round_the_circle():
    parameters = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.6), electronics=WTS_0614_34)
    scene = Scene(parameters, Sphere(radius=5e-3), load=WEIGHT, method=Foundation(modulus=1e9))
    carried, places, centres = [], [], []
    for moment in scene.run(6.0):
        frame = scene.sensor.frame()
        carried.append(scene.sensor.carried())
        if moment > 2.0:
            places.append(scene.position)
            centres.append(frame.texel_forces @ ARRAY.centres[:, :2] / frame.texel_forces.sum())
    assert carried[0] == 0.0
    assert max(carried) < 1.01 * WEIGHT
    np.testing.assert_allclose(carried[-len(places) :], WEIGHT, rtol=1e-3)
    radius = np.hypot(*np.transpose(places))
    np.testing.assert_allclose(radius, 0.2 * 6 * 3.4e-3, rtol=0.02)
    assert np.ptp(np.transpose(places), axis=1) == pytest.approx(2 * radius[:2].mean(), rel=0.02)
    assert np.abs(np.subtract(centres, places)).max() < 0.5e-3


def test_a_restarted_scene_repeats_the_first_run():
    parameters = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.6), electronics=WTS_0614_34)
    scene = Scene(parameters, Sphere(radius=5e-3), load=WEIGHT, method="boxes")
    first = list(scene.run(0.8))
    before = scene.sensor.frame().texel_forces
    scene.restart()
    assert not scene.sensor.frame().texel_forces.any()
    assert list(scene.run(0.8)) == first
    np.testing.assert_array_equal(scene.sensor.frame().texel_forces, before)
    assert before.sum() > 0.1
