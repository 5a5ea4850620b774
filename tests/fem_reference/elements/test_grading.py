"""Graded meshes: they reach their ends, ascend, and have the element sizes that were asked for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.elements.grading import (
    fill_by_spacing,
    grade_around_edge,
    grade_contact,
    grade_outward,
    growing_steps,
    layer_heights,
)

QUICK = settings(max_examples=50, deadline=None)
SIZES = st.floats(0.02, 0.3)
LENGTHS = st.floats(0.5, 5.0)


@QUICK
@given(size=SIZES, even=LENGTHS, beyond=st.floats(1.0, 50.0), growth=st.floats(1.05, 1.8))
def test_a_mesh_from_the_axis_is_even_then_grows_to_its_end(size, even, beyond, growth):
    nodes = grade_outward(size, even, even + beyond, growth)
    steps = np.diff(nodes)
    count = round(even / size)
    assert nodes[0] == 0
    assert nodes[-1] == pytest.approx(even + beyond)
    assert steps[:count] == pytest.approx(np.full(count, even / count))
    assert steps[count + 1 :] / steps[count:-1] == pytest.approx(np.full(len(steps) - count - 1, growth))
    assert steps[count] <= growth * size * (1 + 1e-9)


@QUICK
@given(fine=st.floats(0.005, 0.05), ratio=st.floats(1.0, 8.0), edge=LENGTHS, beyond=LENGTHS)
def test_a_mesh_around_an_edge_is_finest_there(fine, ratio, edge, beyond):
    nodes = grade_around_edge(fine, ratio * fine, edge, edge + beyond, 1.2)
    steps = np.diff(nodes)
    at = int(np.argmin(np.abs(nodes - edge)))
    assert nodes[[0, -1]] == pytest.approx([0, edge + beyond])
    assert nodes[at] == pytest.approx(edge)
    assert (steps > 0).all()
    assert steps[at - 1] == pytest.approx(fine)
    assert steps[:at].max() <= 1.5 * ratio * fine * (1 + 1e-9)  # the innermost element takes what is left
    # towards the edge steps shrink by 1.2^2, beyond the largest inner step they grow by 1.2
    np.testing.assert_allclose(steps[1 : at - 1], np.minimum(1.2**2 * steps[2:at], ratio * fine), rtol=1e-9)
    outer = steps[at:-1]
    growth = np.where(outer[:-1] < ratio * fine * (1 - 1e-9), 1.2**2, 1.2)
    unclear = np.isclose(outer[:-1], ratio * fine)
    np.testing.assert_allclose(outer[1:][~unclear], (growth * outer[:-1])[~unclear], rtol=1e-9)


@QUICK
@given(low=st.floats(0.05, 0.3), high=st.floats(0.05, 0.3), length=LENGTHS)
def test_nodes_follow_a_wanted_spacing(low, high, length):
    places = np.linspace(0, length, 4001)
    spacing = np.interp(places, [0, length], [low, high])
    nodes = fill_by_spacing(places, spacing, parts=2)
    steps, wanted = np.diff(nodes), np.interp((nodes[1:] + nodes[:-1]) / 2, places, spacing)
    assert nodes[[0, -1]] == pytest.approx([0, length])
    ratio = 2 * steps / wanted
    assert ratio.max() <= 1.02  # never larger than wanted, but for the curvature of the spacing
    assert ratio.min() >= ratio.max() * 0.97  # the same part of the wanted size everywhere


@QUICK
@given(
    layers=st.lists(st.tuples(st.floats(0.05, 3.0), st.integers(1, 6)), min_size=1, max_size=4),
    base=st.floats(1.0, 2.0),
    surface=st.floats(1.0, 2.0),
)
def test_layers_keep_their_thickness_and_number_of_elements(layers, base, surface):
    thicknesses, counts = zip(*layers, strict=True)
    heights, layer = layer_heights(thicknesses, counts, crowd_base=base, crowd_surface=surface)
    assert (np.diff(heights) > 0).all()
    for number, (thickness, count) in enumerate(layers):
        assert np.diff(heights)[layer == number].sum() == pytest.approx(thickness)
        assert (layer == number).sum() == count


def test_elements_shrink_to_the_size_at_the_surface():
    heights, layer = layer_heights([1.0, 2.0], [2, 4], surface_size=0.05)
    steps = np.diff(heights)
    assert steps[-1] == pytest.approx(0.05, rel=0.25)  # scaled so that the steps fill the layer
    assert (np.diff(steps[layer == 1]) < 1e-12).all()
    assert steps[layer == 0] == pytest.approx([0.5, 0.5])
    assert heights[-1] == pytest.approx(3.0, abs=1e-14)
    coarse, _ = layer_heights([1.0, 2.0], [2, 4], surface_size=0.6)
    assert coarse == pytest.approx([0, 0.5, 1, 1.5, 2, 2.5, 3])


@pytest.mark.parametrize(
    ("spare", "steps"), [(0.0, [1, 2, 4, 8]), (0.6, [1, 2, 4]), (0.37, [1, 2, 4, 8]), (1.7, [1, 2, 4])]
)
def test_steps_are_added_while_the_rest_exceeds_a_share_of_the_next_one(spare, steps):
    """Of 10, after 1, 2 and 4 a rest of 3 remains, 0.375 of the next step of 8."""
    assert growing_steps(1.0, 10.0, lambda step: 2 * step, spare=spare).tolist() == steps


def test_nodes_of_a_contact_have_the_smallest_steps_at_its_edge():
    """Steps grow by half on both sides, inside up to the largest one, and are scaled to fill the contact."""
    nodes = grade_contact(1.0, 2.0, fine=0.1, most=0.3)
    inner = np.array([0.1, 0.15, 0.225, 0.3, 0.3]) / 1.075
    outer = 0.1 * 1.5 ** np.arange(6)
    assert np.diff(nodes) == pytest.approx([*inner[::-1], *outer])
    assert (nodes[0], nodes[5]) == (0.0, pytest.approx(1.0))
    assert nodes[-1] > 3.0 > nodes[-2]


def test_a_strip_inside_an_edge_keeps_the_smallest_steps():
    nodes = grade_around_edge(0.1, 0.4, 2.0, 4.0, 1.2, even=0.5)
    steps, at = np.diff(nodes), int(np.argmin(np.abs(nodes - 2.0)))
    # Five in the strip, and the first one of those that grow by the square of the ratio.
    assert steps[at - 6 : at] == pytest.approx(np.full(6, 0.1))
    assert steps[at - 9 : at - 6] == pytest.approx(0.1 * 1.44 ** np.array([3, 2, 1]))
    assert steps[at : at + 4] == pytest.approx(0.1 * 1.44 ** np.arange(4))
    assert nodes[[0, -1]] == pytest.approx([0, 4])


@pytest.mark.parametrize(
    ("options", "count"),
    [({}, 3), ({"least": 5}, 5), ({"parts": 1}, 4), ({"parts": 2}, 8), ({"parts": 2, "least": 9}, 9)],
)
def test_numbers_of_elements_are_rounded_or_rounded_up_before_the_division(options, count):
    """A length of 1 holds 3.33 elements of 0.3."""
    nodes = fill_by_spacing(np.linspace(0, 1, 11), np.full(11, 0.3), **options)
    assert nodes == pytest.approx(np.linspace(0, 1, count + 1))


def test_edges_crowd_at_the_base_and_below_the_surface_by_powers():
    part = np.arange(1, 5) / 4
    heights, layer = layer_heights([1.0, 2.0], [2, 4], crowd_base=1.5, crowd_surface=1.4)
    assert heights == pytest.approx([0, 0.5**1.5, 1, *(1 + 2 * (1 - (1 - part) ** 1.4))])
    assert layer.tolist() == [0, 0, 1, 1, 1, 1]
    one, _ = layer_heights([2.0], [4], crowd_base=1.5, crowd_surface=1.4)
    assert one == pytest.approx([0, *(2 * (1 - (1 - part**1.5) ** 1.4))])


def test_elements_below_a_fine_surface_grow_to_the_even_height():
    """From 0.1 by 1.4 to 0.5: 0.1, 0.14, 0.196, 0.2744, 0.38416, 0.5 and 0.5 exceed 2."""
    heights, _ = layer_heights([2.0], [4], surface_size=0.1)
    steps = np.array([*(0.1 * 1.4 ** np.arange(5)), 0.5, 0.5])
    assert np.diff(heights)[::-1] == pytest.approx(2 * steps / steps.sum())
