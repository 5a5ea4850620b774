"""Element edges of covers under point loads, with texels, and beside free sides, against rules that are written out."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fem_reference.elements.grading import grade_outward
from fem_reference.linear_response import axisymmetric
from fem_reference.linear_response.axisymmetric import RadialCover, point_spread, solve_point_load
from fem_reference.linear_response.finite_cover import Resolution, mesh_quarter
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import decay_length
from fem_reference.small_strain_contact import free_edges
from fem_reference.small_strain_contact.free_edges import SideEdges
from meshes import Box, Sphere, TexelArray
from meshes.pose import Pose
from tests.support.rubber import stack_layers

H = 2e-3
LAYERS = ((1.3e-3, 1e6, 0.4), (0.7e-3, 2e6, 0.3))
FOIL = stack_layers((2e-3, 1e5, 0.3), (0.1e-3, 1e11, 0.3))


class Caught(Exception):  # noqa: N818 -- ends a solution early
    """What a mesh was asked for."""


def fill(low, high, spacing, parts=None):
    """Places of elements whose number is the integral of 1 / spacing, by the midpoint rule; cut into parts."""
    x = np.linspace(low, high, 40_001)
    counted = np.append(0.0, np.cumsum(np.diff(x) / spacing((x[1:] + x[:-1]) / 2)))
    count = max(1, round(counted[-1])) if parts is None else int(np.ceil(counted[-1])) * parts
    return np.interp(np.arange(count + 1) * counted[-1] / count, counted, x)


def chain(marks, spacing, parts=None):
    """Element edges between all marks, each of which is an edge; `spacing` takes the ends of its part."""
    each = [fill(*ends, lambda x, ends=ends: spacing(x, *ends), parts)[1:] for ends in pairwise(marks)]
    return np.concatenate([[marks[0]], *each])


@pytest.mark.parametrize(("cover", "count"), [(stack_layers(*LAYERS), 8), (FOIL, 12)])
def test_a_point_load_has_even_elements_to_four_thicknesses(cover, count, monkeypatch):
    def mesh(_cover, elements, radii, **_):
        raise Caught(elements, radii)

    monkeypatch.setattr(RadialCover, "mesh", mesh)
    with pytest.raises(Caught) as caught:
        solve_point_load(cover, elements_per_thickness=count, reach=50e-3)
    elements, radii = caught.value.args
    assert elements == count
    assert radii == pytest.approx(grade_outward(1 / count, 4.0, 50e-3 / cover.thickness, 1 + 1.2 / count))


@pytest.mark.parametrize("cover", [stack_layers(*LAYERS), FOIL])
def test_a_point_spread_is_solved_on_three_grids_to_sixteen_decay_lengths(cover, monkeypatch, tmp_path):
    asked, told = [], []

    def solve(given, **options):
        asked.append((given, options))
        count = options["elements_per_thickness"]
        return PointSpread(radius=np.arange(3.0), pressure_per_force=np.full(3, count), reaction=1.0, thickness=H)

    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    monkeypatch.setattr(axisymmetric, "solve_point_load", solve)
    found = point_spread(cover, progress=told.append)
    assert asked == [
        (cover, {"elements_per_thickness": n, "reach": pytest.approx(16 * decay_length(cover))}) for n in (8, 12, 18)
    ]
    assert [each.pressure_per_force[0] for each in found.on_grids] == [8, 12, 18]
    assert told == [f"axisymmetric solve, {n} elements through the cover" for n in (8, 12, 18)]


@pytest.mark.parametrize(
    ("texels", "marks", "middle"),
    [
        # An odd number of texels has no edge in the middle, an even one without gaps has one.
        ((3, 2.4e-3, 2e-3), [0, 0.5, 0.7, 1.7, 7.5], False),
        ((2, 3e-3, 3e-3), [0, 1.5, 7.5], True),
        # Gaps narrower than a twentieth of an element are left out, also at the side.
        ((4, 3e-3, 2.94e-3), [0, 0.015, 1.485, 1.515, 2.985, 7.5], False),
        ((2, 3e-3, 2.8e-3), [0, 0.05, 1.45, 7.5], False),
        ((5, 6e-3, 2.98e-3), [0, 0.745, 2.255, 3.745, 5.255, 6.745, 7.5], False),
        ((6, 5.005e-3, 4.9e-3), [0, 0.02625, 2.47625, 2.52875, 4.97875, 5.03125, 7.48125, 7.5], False),
    ],
)
@pytest.mark.parametrize("across", [0.8, 1.9])
def test_elements_grow_away_from_edges_of_texels_and_of_the_cover(texels, marks, middle, across):
    """1 / across up to two thicknesses from an edge, and 0.35 of the distance beyond more."""
    cover, (columns, pitch, texel) = stack_layers(*LAYERS, size=(30e-3, 26e-3)), texels
    array = TexelArray.grid(1, columns, (pitch, 4e-3), texel_size=(texel, 3e-3))
    sliver = 0.05 / across
    kept = [0.0]
    for mark in marks[1:-1]:
        if mark - kept[-1] > sliver and marks[-1] - mark > sliver:
            kept.append(mark)
    kept.append(marks[-1])

    def spacing(x, low, high):
        distance = np.minimum(high - x, x - low if low > 0 or middle else np.inf)
        return (1 + 0.35 * np.maximum(distance - 2, 0)) / across

    solid = mesh_quarter(cover, array, Resolution(across=across, through=5))
    assert solid.edges[0] == pytest.approx(chain(kept, spacing), abs=1e-4)
    along_y = chain(
        [0, 0.75, 6.5],
        lambda x, low, high: (
            (1 + 0.35 * np.maximum(np.minimum(high - x, x - low if low > 0 else np.inf) - 2, 0)) / across
        ),
    )
    assert solid.edges[1] == pytest.approx(along_y, abs=1e-4)
    # Three and two of five elements through the layers, crowded at the base.
    part = np.arange(4) / 3
    assert solid.edges[2] == pytest.approx([*(0.65 * part**1.5), 0.825, 1.0])
    assert solid.layer.tolist() == [0, 0, 0, 1, 1]


#: Indenter, place and half widths of a contact; size of the cover; distances of the contact from the middle and size of
#: the elements at the sides [thicknesses].
BESIDE = [
    # Four thirds of the distance to the nearest side, from one half to two thicknesses.
    ((Sphere(radius=9e-3), (0.6e-3, -0.9e-3), (1.2e-3, 0.5e-3)), (5e-3, 4.2e-3), ((0, 0.9), (0.2, 0.7)), 0.5),
    ((Sphere(radius=9e-3), (0.6e-3, -0.9e-3), (1.2e-3, 0.5e-3)), (6.2e-3, 5.6e-3), ((0, 0.9), (0.2, 0.7)), 2.6 / 3),
    ((Sphere(radius=9e-3), (0.6e-3, -0.9e-3), (1.2e-3, 0.5e-3)), (12e-3, 11e-3), ((0, 0.9), (0.2, 0.7)), 2.0),
    # At least 0.15 of the width of the contact counts as distance.
    ((Sphere(radius=90e-3), (0.0, 0.0), (6e-3, 5.6e-3)), (12.4e-3, 11.6e-3), ((0, 3.0), (0, 2.8)), 0.56),
    # Edges of a face are edges of elements, unless they lie within 0.02 thicknesses of the middle or a side.
    (
        (Box(size=(2e-3, 1e-3, 1e-3)), (1.3e-3, -0.9e-3), (1e-3, 0.5e-3)),
        (6.2e-3, 5.6e-3),
        ((0.15, 1.15), (0.2, 0.7)),
        1.6 / 3,
    ),
    (
        (Box(size=(2e-3, 1e-3, 1e-3)), (1.03e-3, -0.9e-3), (1e-3, 0.5e-3)),
        (4.1e-3, 5.6e-3),
        ((0.015, 1.015), (0.2, 0.7)),
        0.5,
    ),
]


@pytest.mark.parametrize("kind", [("bonded", 8), ("sliding", 40)])
@pytest.mark.parametrize("case", BESIDE)
def test_elements_beside_free_sides_follow_contact_and_sides(kind, case, monkeypatch):
    ((shape, at, half), size, spans, element), (base, beyond), asked = case, kind, []
    monkeypatch.setattr(free_edges, "build_solid", lambda *given, **options: asked.append((given, options)))
    monkeypatch.setattr(free_edges, "_solve_flexibility", lambda *_, **__: [np.zeros((1, 1))])
    cover = stack_layers(*LAYERS, size=size, base=base)
    sides = SideEdges(cover=cover, indenter=shape, pose=Pose.planar(at=at), half=np.array(half))
    sides.add_compliance(np.zeros(1), np.zeros(1))
    (_, alone, layer), _ = asked[0]
    (_, surrounded, _), options = asked[1]
    for axis, ((low, high), edge) in enumerate(zip(spans, size, strict=True)):
        end = edge / 2 / H

        def spacing(x, *_, low=low, high=high, end=end):
            beside = np.maximum(np.maximum(low - x, x - high), 0)
            return np.minimum(element + 1.2 * (end - x), np.maximum((high - low) / 1.5, element) + 1.2 * beside)

        sharp = [each for each in (low, high) if shape.is_flat and 0.02 < each < end - 0.02]
        inner = chain([0.0, *sharp, end], spacing, 3)
        assert alone[axis] == pytest.approx(inner, abs=2e-4)
        far = beyond * decay_length(cover) / H
        outer = fill(0, far, lambda x: element + 1.6 * x, 3)[1:]
        assert surrounded[axis] == pytest.approx([*inner, *(end + outer)], rel=2e-4, abs=2e-4)
        assert options["breaks"][axis] == (len(inner) - 1,)
    # Two elements below and one above, crowded at the top.
    assert alone[2] == pytest.approx([0, 0.325, 0.65, 1.0])
    assert layer.tolist() == [0, 0, 1]
