"""Drawing of texel values on a curved cover as inline SVG: the surface is unrolled about the array's middle texel.

Each texel is a square with its value at its place in the surface coordinates of the middle texel.  Lengths are true
along arcs through this texel on cylinders and spheres; elsewhere the drawing is a map like any other of a round body.
"""

from __future__ import annotations

import html

import numpy as np
from scipy.spatial.distance import pdist

from fastmodel.fitting.surface_gaussian import unroll_from
from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.curved.touch import find_middle
from validation.report.tactile_image import Scale, choose_ink, shorten

#: Longest edge of the drawing and its margin in its own units, and largest width and height on the page [px]: three
#: drawings stand side by side.
_SIZE, _MARGIN, _WIDEST, _HIGHEST = 200.0, 2.0, 190.0, 270.0
#: Edge of a square over the smallest distance of two texels, and size of the printed value over the edge [-].
_EDGE, _FONT = 0.94, 0.36


def surface_map(array: TexelArray, values: FloatArray, scale: Scale, *, name: str) -> str:
    """Draw the values of the active texels, each as a coloured square with its value, as an SVG element with a label.

    Args:
        array: The n texels.
        values: Value of each texel, shape (n,).
        scale: Colour scale.
        name: What is shown, for its label.
    """
    shown = np.flatnonzero(array.active)
    places = _place_squares(array)[shown]
    edge = _EDGE * (float(pdist(places, "chebyshev").min()) if len(places) > 1 else 1.0)
    low, high = places.min(axis=0) - edge / 2, places.max(axis=0) + edge / 2
    factor = (_SIZE - 2 * _MARGIN) / float((high - low).max())
    width, height = (factor * (high - low) + 2 * _MARGIN).tolist()
    size = factor * edge
    cells = []
    for texel, (x, y) in zip(shown, _MARGIN + factor * (places - low), strict=True):
        value = float(values[texel])
        colour = scale.colour(value)
        title = f"texel {texel}: {value * scale.factor:.4g} {scale.unit}"
        left, upper = x - size / 2, height - y - size / 2
        cells.append(
            f'<rect x="{left:.2f}" y="{upper:.2f}" width="{size:.2f}" height="{size:.2f}" fill="{colour}">'
            f'<title>{title}</title></rect><text x="{x:.2f}" y="{height - y + size * _FONT / 3:.2f}" '
            f'font-size="{size * _FONT:.2f}" fill="{choose_ink(colour)}" text-anchor="middle">'
            f"{shorten(value * scale.factor)}</text>"
        )
    largest = int(shown[np.argmax(np.abs(values[shown]))])
    label = html.escape(
        f"{name}: {len(shown)} texels; largest {values[largest] * scale.factor:.4g} {scale.unit} on texel {largest}"
    )
    zoom = min(_WIDEST / width, _HIGHEST / height)
    return (
        f'<svg class="tactile" viewBox="0 0 {width:.1f} {height:.1f}" width="{zoom * width:.0f}" '
        f'height="{zoom * height:.0f}" role="img" aria-label="{label}">{"".join(cells)}</svg>'
    )


def _place_squares(array: TexelArray) -> FloatArray:
    """Return the places of the texels in the surface coordinates of the middle one, shape (n, 2) [m]."""
    middle = find_middle(array)
    return np.asarray(unroll_from(array, array.centres[[middle]], array.normals[[middle]])[0])
