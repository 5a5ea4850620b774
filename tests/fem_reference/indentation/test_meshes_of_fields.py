"""Meshes on which fields are solved, and problems on blocks, as they are set up; nothing is solved."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.elements.grading import grade_contact, grade_outward
from fem_reference.finite_strain import block_path
from fem_reference.finite_strain.block_path import lay_out_block, press_paired
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import linear_fields
from fem_reference.indentation.linear_fields import solve_linear_fields
from fem_reference.linear_response.surface_compliance import (
    choose_friction_reach,
    choose_linear_reach,
    choose_solid_reach,
)
from meshes import Box, Cylinder, Prism, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import make_cover, stack_layers

H = 2e-3
COVER = stack_layers((1.5e-3, 1e6, 0.4), (0.5e-3, 4e8, 0.3))
PLACE = Place(array=TexelArray.grid(2, 2, 3e-3), pose=Pose())
#: A triangle mirrors in no plane.
TRIANGLE = Prism(points=((0.0, 0.0), (4e-3, 0.0), (0.0, 6e-3)))


class Caught(Exception):  # noqa: N818 -- ends a solution early
    """What a mesh was asked for."""


def catch(monkeypatch, indenter, contact, friction=0.0, cover=COVER):
    def stop(*given, **options):
        raise Caught(given, options)

    monkeypatch.setattr(linear_fields.RadialCover, "mesh", stop)
    monkeypatch.setattr(linear_fields, "mesh_block", stop)
    path = LoadingPath(cover=cover, indenter=indenter, targets=(1e-5,), control="depth", friction=friction)
    columns = np.zeros((len(contact), 5 if friction else 3))
    columns[:, :2] = contact
    with pytest.raises(Caught) as caught:
        solve_linear_fields(path, columns, PLACE, 1e-5)
    return caught.value.args


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("radius", [4.2e-3, 0.9e-3])
def test_fields_around_an_axis_have_even_elements_beyond_the_contact(monkeypatch, friction, radius):
    """Sixteen through the cover and twenty-four along the radius at least; even to 1.3 radii."""
    contact = np.array([[0.0, 0.0], [radius, 0.0]])
    (cover, count, radii), options = catch(monkeypatch, Cylinder(radius=5e-3), contact, friction)
    # Four points stand for a cell, three eighths of it from its middle; one row has no width.
    farthest = radius * (1 + 3 / 8)
    size = min(1 / 16, farthest / H / 24)
    choose = choose_friction_reach if friction else choose_linear_reach
    assert choose_friction_reach(COVER, 1e-3) > choose_linear_reach(COVER, 1e-3)
    expected = grade_outward(size, 1.3 * farthest / H, choose(COVER, farthest) / H, 1 + 1.2 / 16)
    assert (cover, count, options["surface_size"]) == (COVER, 16, pytest.approx(size))
    assert radii == pytest.approx(expected)


@pytest.mark.parametrize(
    ("indenter", "half"),
    [
        # Four through the cover, four along a narrow contact, at most fourteen along its half.
        (Box(size=(9e-3, 9e-3, 2e-3)), (1.6e-3, 0.5e-3)),
        (Box(size=(60e-3, 60e-3, 2e-3)), (9e-3, 16e-3)),
        (TRIANGLE, (1.6e-3, 0.5e-3)),
    ],
)
def test_fields_below_a_shape_have_the_smallest_elements_at_the_contact_edge(monkeypatch, indenter, half):
    contact = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) * half
    block, cover, count = catch(monkeypatch, indenter, contact)[0]
    assert count == 4
    assert cover.thickness == pytest.approx(1.0)
    # Two cells along each axis: their points reach three eighths of the distance of the cells beyond.
    reach = choose_solid_reach(COVER) / H
    ends = [each * (1 + 2 * 3 / 8) / H for each in half]
    found = [max(min(1.0, 2 * end) / 4, end / 14) for end in ends]
    sides = [grade_contact(end, reach, fine=0.5 * size, most=1.2 * size) for end, size in zip(ends, found, strict=True)]
    if indenter is TRIANGLE:
        sides = [np.concatenate([-side[:0:-1], side]) for side in sides]
    assert block.size == pytest.approx(min(found))
    assert block.symmetric == ((False, False) if indenter is TRIANGLE else (True, True))
    for side, expected in zip(block.sides, sides, strict=True):
        assert side == pytest.approx(expected)


class Problem:
    """A problem on a block; the second one that is followed ends the press."""

    seen: list[SimpleNamespace]

    def __init__(self, **options):
        self.options = options

    def follow(self, targets, **options):
        Problem.seen.append(SimpleNamespace(targets=targets, **self.options, **options))
        if len(Problem.seen) == 2:
            raise Caught
        return []


@pytest.mark.parametrize(("friction", "overlap"), [(0.0, 2e-3), (0.3, 5e-4)])
def test_a_baseline_has_no_friction_and_small_strain_and_the_path_more_steps(monkeypatch, friction, overlap):
    """A quarter of a face 3 mm x 2 mm on two elements through 2 mm; units of its thickness."""
    face = Box(size=(3e-3, 2e-3, 1e-3))
    path = LoadingPath(
        cover=make_cover(0.45), indenter=face, targets=(0.1e-3, 0.4e-3), control="depth", friction=friction
    )
    block = lay_out_block(path, elements_per_thickness=2, contact_half=face.footprint, fillet=0.4e-3, reach=1e-3)
    Problem.seen = []
    monkeypatch.setattr(block_path, "ContactProblem", Problem)
    with pytest.raises(Caught):
        press_paired(path, block, (0.12e-3, 0.5e-3), elements_per_thickness=2)
    small, full = Problem.seen
    assert (small.friction_steps, full.friction_steps) == (0, 6)
    assert (small.overlap, full.overlap) == (2e-3, overlap)
    assert (small.load_scale, full.load_scale) == (1e-3, 1.0)
    assert (small.first, full.first) == (pytest.approx(2e-5), pytest.approx(0.02))
    assert small.targets == pytest.approx([0.05e-3, 0.2e-3])
    assert full.targets == pytest.approx([0.05, 0.2])
    assert [guess.depth for guess in small.guesses] == pytest.approx([0.06e-3, 0.25e-3])
    assert not any(guess.state.any() for guess in small.guesses)
    assert list(full.guesses) == []
    assert (small.contact.friction, full.contact.friction) == (0.0, friction)
    for each, scale in ((small, 1e-3), (full, 1.0)):
        assert each.contact.multiple == 4.0
        state = np.zeros_like(small.guesses[0].state)
        found = each.contact.evaluate(state, 0.1 * scale)
        assert found.pressure.max() == pytest.approx(300 / 0.5 * 0.1 * scale)
        assert found.area == pytest.approx(6e-6 / H**2, rel=0.15)
