"""Texels on curved bases: their tangent axes, the part of the base that each covers, and two layouts.

A texel covers a region of the base on the side to which the texel's normal points.  The region is the set of points
whose projection along the normal lies in the texel's rectangle, whose edges are along the two tangent axes.
Overlapping texels share their overlap equally.  Texels that touch each other overlap on a convex base.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from meshes.array import TexelArray
from meshes.array_types import FloatArray

#: Sine of the angle between a normal and the y axis below which the second tangent axis is taken from -z [-].
_POLE = 1e-6


def tangent_axes(normals: FloatArray) -> FloatArray:
    """Return the tangent axes of texels.

    The second axis is the projection of the array's y axis, the first is y cross normal.  Where the normal points
    along y, the second axis is -z.  On a planar array the axes are x and y.

    Args:
        normals: Unit normals, shape (n, 3) [-].

    Returns:
        Both unit axes of each texel, shape (n, 2, 3) [-].
    """
    second = np.array([0.0, 1.0, 0.0]) - normals[:, [1]] * normals
    length = np.linalg.norm(second, axis=1, keepdims=True)
    down = np.array([0.0, 0.0, -1.0]) + normals[:, [2]] * normals
    second = np.where(length > _POLE, second / np.maximum(length, _POLE), down)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack([np.cross(second, normals), second], axis=1)


def covered_share(texels: TexelArray, points: FloatArray, normals: FloatArray, spread: FloatArray) -> FloatArray:
    """Compute which fraction of small parts of the base each texel covers.

    Args:
        texels: Array of n texels.
        points: Middles of p parts of the base, shape (p, 3) [m].
        normals: Unit normals of the base at these points, shape (p, 3) [-].
        spread: Edge vectors of the parts, which count as parallelograms, shape (p, 2, 3) [m].

    Returns:
        Shares, shape (n, p) [-]; their sum over the texels is at most 1.
    """
    axes = tangent_axes(texels.normals)
    out = np.empty((texels.count, len(points)))
    for number, (centre, pair) in enumerate(zip(texels.centres, axes, strict=True)):
        share = (normals @ texels.normals[number] > 0).astype(float)
        for axis, edge in zip(pair, texels.texel_size, strict=True):
            place, half = (points - centre) @ axis, np.abs(spread @ axis).sum(axis=1) / 2
            overlap = np.minimum(place + half, edge / 2) - np.maximum(place - half, -edge / 2)
            share *= np.clip(overlap / np.maximum(2 * half, np.finfo(float).tiny), 0.0, 1.0)
        out[number] = share
    return np.asarray(out / np.maximum(out.sum(axis=0), 1.0))


def cylinder_texels(
    radius: float, *, rows: int, columns: int, pitch: tuple[float, float], size: tuple[float, float], name: str
) -> TexelArray:
    """Place texels on a cylinder about y, in rows along y and columns around; the middle of the array is at z = radius.

    Args:
        radius: Radius of the base [m].
        rows: Number of texels along y [-].
        columns: Number of texels around the cylinder [-].
        pitch: Distance of neighbours around, along the arc, and along y [m].
        size: Edge lengths of a texel around, along the chord, and along y [m].
        name: Name of the array.
    """
    turn, y = np.meshgrid(
        (np.arange(columns) - (columns - 1) / 2) * pitch[0] / radius, (np.arange(rows) - (rows - 1) / 2) * pitch[1]
    )
    normals = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], axis=-1).reshape(-1, 3)
    centres = radius * normals + np.stack([0 * y, y, 0 * y], axis=-1).reshape(-1, 3)
    grid = TexelArray.grid(rows, columns, pitch, texel_size=size, name=name)
    return replace(grid, centres=centres, normals=normals)


def fingertip_texels(radius: float, length: float, *, pitch: float, size: float, name: str) -> TexelArray:
    """Place texels on half a cylinder about y and on the quarter sphere at its end, as on a fingertip.

    The half cylinder extends from y = -length to 0.  The texels lie in rings, and all texels of a ring have the same y.

    Args:
        radius: Radius of the base [m].
        length: Length of the cylinder [m].
        pitch: Wanted distance of neighbours along rings and from ring to ring [m].
        size: Edge length of a texel [m].
        name: Name of the array.
    """
    rows = max(1, round(length / pitch))
    rings = [(0.0, y) for y in (np.arange(rows) + 0.5) * length / rows - length]
    quarter = max(1, round(radius * np.pi / 2 / pitch))
    rings += [(latitude, 0.0) for latitude in (np.arange(quarter) + 0.5) * np.pi / 2 / quarter]
    normals, centres = [], []
    for latitude, y in rings:
        count = max(1, int(radius * np.cos(latitude) * np.pi / pitch + 1e-9))
        turn = (np.arange(count) + 0.5) * np.pi / count - np.pi / 2
        around = np.cos(latitude) * np.stack([np.sin(turn), np.zeros(count), np.cos(turn)], axis=1)
        each = around + np.array([0.0, np.sin(latitude), 0.0])
        normals.append(each)
        centres.append(radius * each + np.array([0.0, y, 0.0]))
    row = TexelArray.grid(1, sum(map(len, centres)), pitch, texel_size=size, name=name)
    return replace(row, centres=np.concatenate(centres), normals=np.concatenate(normals))
