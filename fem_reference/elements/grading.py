"""Compute the element edges of every mesh of the package, one direction at a time.

The meshes are tensor products, so the element edges along x, y and z (or r and z) are independent.  Element sizes
follow from steps that grow from a small first step (`growing_steps` and the functions that use it), or from an element
size prescribed at every position (`fill_by_spacing`). `layer_heights` divides the layers of a cover into elements.
Lengths may have any unit, but all arguments of a call must have the same unit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Distance of a node from a boundary of a mesh, over the cover thickness, below which it counts as on the boundary [-].
ON_BOUNDARY = 1e-9
#: Ratio of the heights of neighbouring elements below a surface with small elements [-].
_SURFACE_GROWTH = 1.4
#: Ratio of the sizes of neighbouring elements on both sides of the edge of a contact, in three-dimensional meshes [-].
_CONTACT_GROWTH = 1.5


def growing_steps(first: float, length: float, grow: Callable[[float], float], *, spare: float = 0.0) -> FloatArray:
    """Fill a length with steps, each computed from the previous step.

    Args:
        first: Size of the first step [length].
        length: Length to fill; steps are added while the unfilled rest exceeds `spare` times the next step [length].
        grow: Function that computes the next step from the previous step.
        spare: Fraction of a step that may remain unfilled [-].  With 0 the steps reach or exceed `length`.

    Returns:
        Sizes of the n steps, shape (n,) [length].
    """
    steps, covered, step = [], 0.0, first
    while length - covered > spare * step:
        steps.append(step)
        covered += step
        step = grow(step)
    return np.array(steps)


def grade_outward(size: float, even: float, reach: float, growth: float) -> FloatArray:
    """Place nodes with equal steps of about `size` from 0 to `even` and with growing steps from `even` to `reach`.

    Args:
        size: Element size near 0 [length].
        even: End of the part with equal steps [length].
        reach: Position of the last node [length].
        growth: Ratio of neighbouring steps beyond `even` [-].

    Returns:
        Positions of the nodes, ascending [length].
    """
    start = np.linspace(0, even, round(even / size) + 1)
    count = int(np.ceil(np.log1p((reach - even) * (growth - 1) / size) / np.log(growth)))
    steps = growth ** np.arange(1, count + 1)
    return np.concatenate([start, even + (reach - even) * np.cumsum(steps) / steps.sum()])


def grade_around_edge(
    fine: float, coarse: float, edge: float, reach: float, growth: float, *, even: float = 0.0
) -> FloatArray:
    """Place nodes from 0 to `reach` with steps that shrink to `fine` on both sides of `edge`.

    Args:
        fine: Step size at `edge` [length].
        coarse: Largest step between 0 and `edge`; beyond `edge`, the step size from which growth slows down [length].
        edge: Position of the node with the smallest steps, such as the edge of a contact [length].
        reach: Position of the last node [length].
        growth: Ratio of neighbouring steps larger than `coarse`; smaller steps grow by the square of the ratio [-].
        even: Width of a strip inside `edge` in which all steps are `fine` [length].

    Returns:
        Positions of the nodes, ascending [length].
    """
    strip = np.full(round(even / fine), fine)
    inner = growing_steps(fine, edge - strip.sum(), lambda step: min(step * growth**2, coarse), spare=1.5)
    inner = np.concatenate([strip, inner])
    outer = growing_steps(fine, reach - edge, lambda step: step * (growth**2 if step < coarse else growth))
    nodes = np.concatenate([[0.0], (edge - np.cumsum(inner))[::-1], [edge], edge + np.cumsum(outer)])
    nodes[-1] = reach
    return nodes


def grade_contact(half: float, reach: float, *, fine: float, most: float) -> FloatArray:
    """Place nodes from the middle of a contact outwards, with the smallest steps at the edge of the contact.

    Args:
        half: Half width of the contact [length].
        reach: Smallest distance of the last node from the edge of the contact [length].
        fine: Step size at the edge of the contact [length].
        most: Largest step inside the contact [length].

    Returns:
        Positions of the nodes, ascending from 0; `half` is the position of a node [length].
    """
    inner = growing_steps(fine, half, lambda step: min(_CONTACT_GROWTH * step, most), spare=0.6)
    inside = half - np.cumsum(inner) * half / inner.sum()
    inside[-1] = 0.0
    outer = growing_steps(fine, reach, lambda step: _CONTACT_GROWTH * step)
    return np.concatenate([inside[::-1], [half], half + np.cumsum(outer)])


def fill_by_spacing(places: FloatArray, spacing: FloatArray, *, least: int = 1, parts: int | None = None) -> FloatArray:
    """Place nodes so that the element sizes follow a prescribed function of the position.

    The number of elements is the integral of 1 / `spacing`, rounded; the nodes divide this integral into equal parts.

    Args:
        places: n positions from the first to the last node, ascending, shape (n,) [length].
        spacing: Prescribed element size at these positions, shape (n,) [length].
        least: Smallest number of elements [-].
        parts: Number of parts into which each element is divided [-].  If given, the number of elements is rounded up
            before the division, so that none is larger than prescribed.  Meshes with other numbers of parts share the
            undivided elements.

    Returns:
        Positions of the nodes, first and last of `places` included [length].
    """
    density = 1 / spacing
    elements = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(places))])
    count = max(least, round(elements[-1]) if parts is None else int(np.ceil(elements[-1])) * parts)
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
    """Divide each layer of a cover into elements along z, of equal height unless an option changes the heights.

    Args:
        thicknesses: Thickness of each layer, bottom layer first [length].
        counts: Number of elements in each layer.
        surface_size: Element height at the surface [length].  If it is smaller than the equal height, the elements of
            the top layer shrink to it towards the surface, and their number follows from their heights.
        crowd_base: Exponent p of the element edges (i / n)^p in the bottom layer of n elements; with p > 1 the elements
            are smaller at the base [-].
        crowd_surface: Exponent p of the depths (i / n)^p of the element edges below the surface in the top layer [-].

    Returns:
        Element edges from 0 upwards, shape (e + 1,) [length], and index of the layer of each of the e elements, shape
        (e,).
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
    """Place element edges in a layer whose elements shrink from `coarse` to `fine` upwards.

    Returns:
        Heights of the edges over the thickness of the layer, in (0, 1] [-].
    """
    steps = growing_steps(fine, thickness, lambda step: min(_SURFACE_GROWTH * step, coarse))
    heights = np.cumsum(steps[::-1]) / steps.sum()
    heights[-1] = 1.0
    return np.asarray(heights)
