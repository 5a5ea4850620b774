"""Compute the response of wide covers to normal and shear tractions on their top, exactly."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fem_reference.closed_form.layer import solve_tractions, transfer
from meshes import Cover
from meshes.array_types import FloatArray

#: Product of wave number and thickness below which linear systems are too ill-conditioned [-].
_SMALL = 2e-3


def traction_compliance(cover: Cover, wave_number: npt.ArrayLike) -> FloatArray:
    """Compute the displacements of the top of a wide cover under normal and shear tractions, for each wave number.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].

    Returns:
        Symmetric matrix for each wave number, shape (m, 2, 2) [m/Pa].  Rows are the displacements downwards, times
        cos(k x), and along +x, times sin(k x).  Columns are the pressure cos(k x) and the shear traction sin(k x) along
        +x on the top.  For axisymmetric loads cos(k x) becomes J0(k r), and sin(k x) becomes J1(k r).
    """
    k = np.atleast_1d(np.asarray(wave_number, dtype=float))
    # At small k the linear systems are ill-conditioned.  There the compliances are constant on the diagonal and
    # proportional to k off the diagonal.
    solvable = np.maximum(k, _SMALL / cover.thickness)
    ratio = k / solvable
    one = np.ones_like(k)
    return np.asarray(solve_tractions(cover, solvable)[0] * np.array([[one, ratio], [ratio, one]]).T)


def transfer_to_base(cover: Cover, wave_number: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the pressure cos(k x) on the base of a wide cover per normal and per shear traction on its top.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].

    Returns:
        Pressure on the base per pressure cos(k x), and per shear traction sin(k x) along +x, shape (m,) each [-].
    """
    solvable = np.maximum(wave_number, _SMALL / cover.thickness)
    shear = solve_tractions(cover, solvable)[1][:, 1] * wave_number / solvable
    return transfer(cover, wave_number).base, shear
