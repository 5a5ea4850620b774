"""Contact areas from pressures of known shape, located below the size of a cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.small_strain_contact.frictionless import measure_area


def grid(cells, half):
    offset = ((np.arange(cells) + 0.5) / cells * 2 - 1) * half
    return *np.meshgrid(offset, offset, indexing="ij"), (2 * half / cells, 2 * half / cells)


@given(radius=st.floats(0.5, 0.9), ratio=st.floats(0.5, 1))
@settings(max_examples=40, deadline=None)
def test_an_elliptical_pressure_has_the_area_of_its_ellipse(radius, ratio):
    x, y, cell = grid(60, 1.0)
    pressure = np.sqrt(np.maximum(0, 1 - (x / radius) ** 2 - (y / radius / ratio) ** 2))
    assert measure_area(pressure, np.ones_like(x, dtype=bool), cell) == pytest.approx(
        np.pi * radius**2 * ratio, rel=1e-3
    )


def test_at_the_edge_of_the_indenter_cells_count_as_a_whole():
    x, y, cell = grid(40, 1.0)
    allowed = np.abs(x) < 0.5
    pressure = np.where(allowed, np.sqrt(np.maximum(0, 0.64 - y**2)), 0.0)
    assert measure_area(pressure, allowed, cell) == pytest.approx(1.6, rel=2e-3)


def test_few_cells_and_odd_pressures_count_as_a_whole():
    pressure = np.zeros((8, 8))
    pressure[3:5, 3:5] = 1.0
    assert measure_area(pressure, np.ones((8, 8), dtype=bool), (2.0, 3.0)) == 24.0
    even = np.zeros((20, 20))
    even[4:16, 4:16] = 1.0
    assert measure_area(even, np.ones((20, 20), dtype=bool), (1.0, 1.0)) == 144.0


@pytest.mark.parametrize(("lean", "wave"), [((0.3, -0.2), 1.5), ((-0.25, 0.3), 2.0), ((0.1, 0.3), 1.0)])
def test_a_leaning_pressure_has_the_area_of_its_ellipse_however_it_is_mirrored(lean, wave):
    """The square of the pressure is no quadratic polynomial, so that the fit depends on where its cells lie."""
    x, y, cell = grid(48, 1.0)
    pressure = np.sqrt(np.maximum(0, 1 - (x / 0.8) ** 2 - (y / 0.6) ** 2))
    pressure *= 1.5 + lean[0] * x + lean[1] * np.sin(wave * y)
    for image in (np.asarray, np.flipud, np.fliplr, np.transpose):
        area = measure_area(image(pressure), np.ones_like(x, dtype=bool), cell)
        assert area == pytest.approx(np.pi * 0.8 * 0.6, rel=3e-4)
