"""Indenters beside one another: footprints that overlap, and presses of several that are refused."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.small_strain_contact import several_indenters
from fem_reference.small_strain_contact.several_indenters import Body, find_overlap, press_together
from meshes import Box, Cylinder, Prism, Sphere, TexelArray
from meshes.pose import Pose
from tests.support.rubber import make_cover, stack_layers

BOX, PIN = Box(size=(4e-3, 2e-3, 1e-3)), Cylinder(radius=1e-3)
#: An L whose notch, beyond (0, 0), has room for a pin.
CORNER = Prism(points=((-3e-3, -3e-3), (3e-3, -3e-3), (3e-3, -1e-3), (-1e-3, -1e-3), (-1e-3, 3e-3), (-3e-3, 3e-3)))
COVER, ARRAY = make_cover(0.45, "linear-elastic"), TexelArray.grid(2, 2, 2e-3)


def place(*bodies):
    return find_overlap([(shape, Pose.planar(at=at, yaw=yaw)) for shape, at, yaw in bodies])


@pytest.mark.parametrize(
    ("bodies", "pair"),
    [
        ([(BOX, (0.0, 0.0), 0.0), (BOX, (3.99e-3, 0.0), 0.0)], (0, 1)),
        ([(BOX, (0.0, 0.0), 0.0), (BOX, (4e-3, 0.0), 0.0)], None),
        ([(BOX, (0.0, 0.0), 0.0), (BOX, (0.0, 2.01e-3), 0.0)], None),
        ([(BOX, (0.0, 0.0), 0.0), (BOX, (0.0, 2.01e-3), np.pi / 2)], (0, 1)),
        ([(BOX, (0.0, 0.0), np.pi / 2), (BOX, (2.01e-3, 0.0), np.pi / 2)], None),
        # The rectangles around two pins overlap, and the pins do not.
        ([(PIN, (0.0, 0.0), 0.0), (PIN, (1.5e-3, 1.5e-3), 0.0)], None),
        ([(PIN, (0.0, 0.0), 0.0), (PIN, (1.35e-3, 1.35e-3), 0.0)], (0, 1)),
        ([(CORNER, (0.0, 0.0), 0.0), (PIN, (0.7e-3, 0.7e-3), 0.0)], None),
        ([(CORNER, (0.0, 0.0), np.pi), (PIN, (0.7e-3, 0.7e-3), 0.0)], (0, 1)),
        (
            [(PIN, (-9e-3, 0.0), 0.0), (PIN, (5e-3, 0.0), 0.0), (PIN, (0.0, 0.0), 0.0), (BOX, (1e-3, 0.5e-3), 0.0)],
            (2, 3),
        ),
    ],
)
def test_footprints_overlap_where_a_point_is_below_both(bodies, pair):
    assert place(*bodies) == pair


def body(**options):
    return Body(**({"indenter": PIN, "load": 1.0} | options))


@pytest.mark.parametrize(
    ("bodies", "words"),
    [
        ([], "needs at least one body"),
        ([body(load=0.0)], "positive load"),
        ([body(load=np.inf)], "positive load"),
        ([body(), body(load=-1.0, at=(9e-3, 0.0))], "positive load"),
        ([body(), body(at=(1e-3, 0.0))], "footprints of two indenters overlap"),
        ([body(), body(at=(0.3, 0.3))], "too far apart to be solved together"),
    ],
)
def test_bodies_that_are_not_solved_together_are_refused(bodies, words):
    with pytest.raises(ValueError, match=words):
        press_together(COVER, ARRAY, bodies)


@pytest.mark.parametrize(("size", "counts"), [((1.3, 0.7), (3, 1)), ((1.2, 0.8), (2, 2)), ((1.5, 1.0), (3, 2))])
def test_cells_begin_at_the_lowest_corner_and_count_where_their_middles_are_below(size, counts, monkeypatch):
    """Cells of 0.5 mm on the finer grid: one whose middle is beside the face bears nothing."""
    wanted = size[0] * size[1] / 0.25
    monkeypatch.setattr(several_indenters, "_MOST_CELLS", 1.001 * wanted)
    low = np.array([-0.4e-3, 0.9e-3])
    length, width = (1e-3 * each for each in size)
    box = body(indenter=Box(size=(length, width, 1e-3)), load=0.3, at=(low[0] + length / 2, low[1] + width / 2))
    found = press_together(COVER, ARRAY, [box], cells=(2, 4))
    assert found.contact[:, 2].sum() == pytest.approx(0.3)
    for k in range(2):
        assert np.unique(found.contact[:, k].round(9)) == pytest.approx(low[k] + 0.5e-3 * (np.arange(counts[k]) + 0.5))
    assert found.contact_area == pytest.approx(0.25e-6 * counts[0] * counts[1])
    monkeypatch.setattr(several_indenters, "_MOST_CELLS", 0.999 * wanted)
    with pytest.raises(ValueError, match="too far apart"):
        press_together(COVER, ARRAY, [box], cells=(2, 4))


def test_the_point_of_a_weight_turns_and_moves_with_its_body():
    found = body(at=(2e-3, -1e-3), yaw=np.pi / 2, centre=(0.5e-3, 0.2e-3)).weight_point
    assert found == pytest.approx([2e-3 - 0.2e-3, -1e-3 + 0.5e-3])
    assert body(indenter=Sphere(radius=1e-3), at=(1e-3, 3e-3)).weight_point == pytest.approx([1e-3, 3e-3])


class Caught(Exception):  # noqa: N818 -- ends a solution early
    """How far the compliance was asked for."""


@pytest.mark.parametrize(
    ("layers", "sizes", "reach"),
    [
        # Four decay lengths, here the thickness, or one and a half diagonals of all footprints.
        (((2e-3, 1e6, 0.3),), (1e-3, 2e-3), 8e-3),
        (((2e-3, 1e6, 0.3),), (6e-3, 2e-3), 1.5 * np.hypot(8e-3, 4.5e-3)),
    ],
)
def test_the_compliance_reaches_beyond_all_footprints_and_the_response(layers, sizes, reach, monkeypatch):
    def stop(_cover, far):
        raise Caught(far)

    monkeypatch.setattr(several_indenters, "surface_compliance", stop)
    monkeypatch.setattr(several_indenters, "point_spread", lambda _: None)
    length, width = sizes
    first = body(indenter=Box(size=(length, width, 1e-3)), at=(length / 2, 0.0))
    bodies = [first]
    if length > 5e-3:
        bodies.append(body(indenter=Box(size=(1e-3, 1e-3, 1e-3)), at=(7.5e-3, 3e-3)))
    with pytest.raises(Caught) as caught:
        press_together(stack_layers(*layers), ARRAY, bodies)
    assert caught.value.args[0] == pytest.approx(reach)
