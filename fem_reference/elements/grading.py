"""Element edges along a line: every mesh of the package takes its spacing from this module.

Meshes here are tensor products, so a mesh is graded one direction at a time.  A direction is filled in one of two ways:
by steps that grow from a fine one (`growing_steps` and the functions on it), or by a wanted element size at every place
(`fill_by_spacing`).  `layer_heights` cuts the layers of a cover.  Lengths may have any unit, the same for all
arguments of a call.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Ratio of neighbouring elements below a surface with small elements, and around the edge of a contact in three
#: dimensions [-].
_SURFACE_GROWTH, _CONTACT_GROWTH = 1.4, 1.5


def growing_steps(first: float, length: float, grow: Callable[[float], float], *, spare: float = 0.0) -> FloatArray:
    """Step along a length, each step computed from the one before.

    Args:
        first: The first step [length].
        length: Steps are taken while more than `spare` of the next step is left of it [length].
        grow: Next step from the last one.
        spare: Part of a step that may be left uncovered; with 0 the steps reach `length` or pass it [-].

    Returns:
        The steps, shape (n,) [length].
    """
    steps, covered, step = [], 0.0, first
    while length - covered > spare * step:
        steps.append(step)
        covered += step
        step = grow(step)
    return np.array(steps)


def grade_outward(size: float, even: float, reach: float, growth: float) -> FloatArray:
    """Nodes with even steps of about `size` from 0 to `even`, then with growing steps that end at `reach` exactly.

    Args:
        size: Element size near 0 [length].
        even: End of the even part [length].
        reach: Last node [length].
        growth: Ratio of neighbouring steps beyond `even` [-].
    """
    start = np.linspace(0, even, round(even / size) + 1)
    count = int(np.ceil(np.log1p((reach - even) * (growth - 1) / size) / np.log(growth)))
    steps = growth ** np.arange(1, count + 1)
    return np.concatenate([start, even + (reach - even) * np.cumsum(steps) / steps.sum()])


def grade_around_edge(fine: float, coarse: float, edge: float, reach: float, growth: float) -> FloatArray:
    """Nodes from 0 to `reach` whose steps shrink to `fine` on both sides of `edge`.

    Args:
        fine: Step at the edge [length].
        coarse: Largest step inside; outside, the step from which on growth slows down [length].
        edge: A node, where the steps are smallest [length].
        reach: Last node [length].
        growth: Ratio of neighbouring steps far outside; its square elsewhere [-].
    """
    inner = growing_steps(fine, edge, lambda step: min(step * growth**2, coarse), spare=1.5)
    outer = growing_steps(fine, reach - edge, lambda step: step * (growth**2 if step < coarse else growth))
    nodes = np.concatenate([[0.0], (edge - np.cumsum(inner))[::-1], [edge], edge + np.cumsum(outer)])
    nodes[-1] = reach
    return nodes


def grade_contact(half: float, reach: float, *, fine: float, most: float) -> FloatArray:
    """Nodes from the middle of a contact outwards: coarse inside, fine at its edge, growing outside.

    Args:
        half: Half width of the contact [length].
        reach: Least distance of the last node from the edge of the contact [length].
        fine: Step at the edge [length].
        most: Largest step inside [length].

    Returns:
        Nodes from 0 on; `half` is one of them.
    """
    inner = growing_steps(fine, half, lambda step: min(_CONTACT_GROWTH * step, most), spare=0.6)
    inside = half - np.cumsum(inner) * half / inner.sum()
    inside[-1] = 0.0
    outer = growing_steps(fine, reach, lambda step: _CONTACT_GROWTH * step)
    return np.concatenate([inside[::-1], [half], half + np.cumsum(outer)])


def fill_by_spacing(places: FloatArray, spacing: FloatArray, *, least: int = 1, round_up: bool = False) -> FloatArray:
    """Nodes between two ends whose distances follow a wanted element size.

    The number of elements is the integral of 1 / `spacing`, rounded; the nodes cut that integral into equal parts.

    Args:
        places: Samples from one end to the other, ascending, shape (n,) [length].
        spacing: Wanted element size at the samples, shape (n,) [length].
        least: Least number of elements [-].
        round_up: Round the number of elements up, so that no element is larger than wanted.

    Returns:
        Nodes, both ends included.
    """
    density = 1 / spacing
    elements = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(places))])
    count = max(least, int(np.ceil(elements[-1]) if round_up else round(elements[-1])))
    nodes = np.interp(np.arange(count + 1) * elements[-1] / count, elements, places)
    nodes[-1] = places[-1]
    return np.asarray(nodes)


def layer_heights(
    thicknesses: Sequence[float],
    counts: Sequence[int],
    *,
    surface_size: float | None = None,
    crowd_base: float = 1.0,
    crowd_surface: float = 1.0,
) -> tuple[FloatArray, IntArray]:
    """Cut each layer of a cover into elements, of equal height unless an option below changes that.

    Args:
        thicknesses: Of the layers, bottom first [length].
        counts: Number of elements in each layer.
        surface_size: Where given and smaller, the elements of the uppermost layer shrink to it towards the surface;
            the number of elements then follows from their sizes [length].
        crowd_base: Power p of the heights (i / n)^p in the lowest layer; above 1 elements are small at the base [-].
        crowd_surface: The same for the depth below the surface in the uppermost layer [-].

    Returns:
        Element edges from 0 up, shape (e + 1,) [length], and the layer of each element, shape (e,).
    """
    heights, layers, bottom, last = [np.zeros(1)], [], 0.0, len(thicknesses) - 1
    for number, (thickness, count) in enumerate(zip(thicknesses, counts, strict=True)):
        even = thickness / count
        part = np.arange(1, count + 1) / count
        if number == 0:
            part = part**crowd_base
        if number == last:
            part = 1 - (1 - part) ** crowd_surface
        if number == last and surface_size is not None and surface_size < even:
            part = _shrink_to_surface(surface_size, even, thickness)
        heights.append(bottom + thickness * part)
        layers += [number] * len(part)
        bottom += thickness
    return np.concatenate(heights), np.array(layers)


def _shrink_to_surface(fine: float, coarse: float, thickness: float) -> FloatArray:
    """Heights over the thickness of a layer whose elements shrink from `coarse` to `fine` upwards, in (0, 1]."""
    steps = growing_steps(fine, thickness, lambda step: min(_SURFACE_GROWTH * step, coarse))
    heights = np.cumsum(steps[::-1]) / steps.sum()
    heights[-1] = 1.0
    return np.asarray(heights)
