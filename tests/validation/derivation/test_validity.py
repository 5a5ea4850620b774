"""The range of the fast model against finite elements, and its tables under load."""

import dataclasses

import numpy as np
import pytest

import fastmodel
from fem_reference import point_spread
from fem_reference.indentation.ball_path import press_ball
from fem_reference.linear_response.membrane_tension import Stretch, StretchedResponse
from fem_reference.linear_response.surface_compliance import membrane_length
from meshes import Cover, Layer, Material, Sphere, TexelArray
from meshes.catalogue import MATERIALS
from validation.derivation.contact_range import (
    _find_limit,
    _repeat_presses,
    measure_misplaced,
    press_ball_on_array,
    state_range,
)

FOIL = Material(name="foil", model="linear-elastic", parameters={"youngs_modulus": 3e9}, poisson_ratio=0.38)
COVER = Cover(
    layers=(
        Layer(thickness=1.5e-3, material=MATERIALS["ecoflex-00-30"]),
        Layer(thickness=0.1e-3, material=FOIL),
    )
)


def test_a_linear_cover_is_in_range_up_to_the_largest_load(derivation):
    found = derivation.parameters.validity
    assert found.strain == "small"
    assert 1 < found.load_2_percent <= found.load_5_percent == found.largest_load
    assert 0 < found.depth_2_percent <= found.depth_5_percent
    assert found.ball_radius == derivation.sensor.array.pitch[0]
    assert derivation.parameters.surface.loads is None


def test_contacts_on_few_cells_do_not_count_and_the_worse_point_does(derivation):
    sensor, parameters = derivation.sensor, derivation.parameters
    presses = press_ball_on_array(sensor.cover, sensor.array, None)
    misplaced, _, resolved = _repeat_presses(parameters, presses)
    counted = resolved.any(axis=0)
    assert not counted[0]
    assert counted.sum() >= 5
    worst = np.where(resolved, misplaced, 0.0).max(axis=0)
    assert worst[-1] > misplaced[1, -1]  # beside the centre of the texel less force is misplaced
    assert parameters.validity.load_2_percent == _find_limit(presses.load[counted], worst[counted], 0.02)
    assert _find_limit(presses.load, misplaced.max(axis=0), 0.02) == 0


@pytest.mark.slow
def test_tension_takes_force_away_and_the_contact_can_be_removed(bonded):
    cover = bonded(0.45)
    spread = point_spread(cover)
    response = StretchedResponse.prepare(cover, spread.radius)
    none, some = Stretch(tension=0.0, length=0.0), Stretch(tension=100.0, length=0.5 * cover.thickness)
    point = response.spread_over_contact(none, 0.0)
    assert point == pytest.approx(spread.pressure_per_force, abs=2e-3 * point.max())
    stretched = response.spread_over_contact(some, 0.0)
    assert stretched[0] < 0.9 * point[0]
    pressed = dataclasses.replace(
        spread, pressure_per_force=response.spread_over_contact(some, 0.5 * cover.thickness), coarse=()
    )
    removed = response.remove_contact(pressed, 0.5 * cover.thickness, some)
    # the pressure is zero beyond the last distance
    assert removed.pressure_per_force[:-1] == pytest.approx(stretched[:-1], abs=1e-9 * point.max())
    assert membrane_length(cover) == 0.0
    assert membrane_length(COVER) == pytest.approx(0.181, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("radius", [2e-3, pytest.param(8e-3, marks=pytest.mark.bench)])
def test_under_a_foil_the_tables_put_the_force_where_finite_strain_has_it(derivation, radius):
    array = TexelArray.grid(8, 8, 2.5e-3)
    spread = point_spread(COVER)
    from validation.derivation.kernel import cover_cells

    plain = dataclasses.replace(
        derivation.parameters, array=array, surface=cover_cells(COVER, array, spread), tables={}, validity=None
    )
    found = state_range(plain, plain.surface, COVER, spread, press_ball_on_array(COVER, array, None))
    assert found.validity.load_5_percent > 2
    path = press_ball(COVER, radius, [0.1 * COVER.thickness, 0.2 * COVER.thickness])
    for load, base in zip(path.load, path.base, strict=True):
        texels = base.texel_influence(array, (0.0, 0.0))[0]
        wanted = load * np.append(texels, 1 - texels.sum())
        before, after = (fastmodel.indent(each, Sphere(radius=radius), load=load) for each in (plain, found))
        assert measure_misplaced(np.append(before.texel_forces, before.outside), wanted) > 0.12
        assert measure_misplaced(np.append(after.texel_forces, after.outside), wanted) < 0.02
