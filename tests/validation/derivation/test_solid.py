"""Responses of the texels of a curved cover from a sensor's description."""

import dataclasses

import numpy as np
import pytest

import fastmodel
from validation.derivation.derive import derive
from validation.report.figures import write_derivation


@pytest.fixture(scope="module")
def derivation(small_pad):
    return derive(small_pad)


def test_a_texel_measures_most_of_a_force_above_it(derivation):
    shares = np.diag(derivation.responses.matrix)
    assert shares.shape == (9,)
    assert (np.argmax(derivation.responses.matrix, axis=1) == np.arange(9)).all()
    assert 0.5 < shares[4] < 1
    np.testing.assert_allclose(shares[[0, 2, 6, 8]], shares[0], rtol=1e-6)  # mirror symmetry


def test_a_uniform_load_spreads_like_the_mean_of_point_loads(derivation):
    uniform = derivation.uniform
    assert uniform[4, 4] < derivation.responses.matrix[4, 4]
    # Loads on all texels of the 9 x 9 mm pad load its whole top: the texels, which cover its base, carry everything.
    np.testing.assert_allclose(uniform.sum(), 9, rtol=2e-3)


def test_derived_files_can_be_loaded(derivation, tmp_path, monkeypatch):
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda *_: ())
    write_derivation(derivation, tmp_path)
    assert (tmp_path / "responses.npz").exists()
    parameters = fastmodel.load(tmp_path)
    np.testing.assert_allclose(parameters.spread.operator(parameters.array), derivation.uniform.T)
    assert parameters.provenance["mesh"] == derivation.mesh.digest


@pytest.mark.parametrize(
    ("turned", "named"),
    [
        ((), ""),
        pytest.param((4,), "4", marks=pytest.mark.slow),
        pytest.param((0, 3, 7), "0, 3, 7", marks=pytest.mark.slow),
        pytest.param(range(9), "6, 7 and 1 more", marks=pytest.mark.slow),
    ],
)
def test_texels_without_a_surface_above_them_are_named(derivation, turned, named):
    """Their normals point away from the cover; texels that are switched off do not count."""
    normals = derivation.sensor.array.normals.copy()
    normals[list(turned)] = [0.0, 0.0, -1.0]

    def find(active):
        array = dataclasses.replace(derivation.sensor.array, normals=normals, active=active)
        return dataclasses.replace(
            derivation,
            sensor=dataclasses.replace(derivation.sensor, array=array),
            responses=dataclasses.replace(derivation.responses, texels=array),
        )

    found = find(np.ones(9, dtype=bool))
    assert np.flatnonzero(found.responses.uncovered).tolist() == list(turned)
    assert len(found.warnings) == bool(turned)
    assert all(f"{named} along the normal" in sentence for sentence in found.warnings)
    assert found.result.warnings == found.warnings
    if 0 < len(turned) < 9:
        assert find(~np.isin(range(9), turned)).warnings == ()
