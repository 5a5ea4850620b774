"""Stress-strain curves of materials in uniaxial tension and compression, and their pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem_reference.materials import measure_stress
from meshes import Material
from meshes.array_types import FloatArray
from validation.errors import InputError, refuse_existing
from validation.extras import require
from validation.output_folder import write_text
from validation.render.figure import COLOURS, COLUMN, open_figure

#: Smallest and largest strain at which the curve of a rubber is drawn [-].
_RUBBER_STRAIN = (-0.5, 1.0)
#: Smallest and largest strain at which the curve of a linear elastic material is drawn [-].
_ELASTIC_STRAIN = (-0.3, 0.3)
#: Number of points of a stress-strain curve [-].
_POINTS = 301


def trace_stress(material: Material) -> tuple[FloatArray, FloatArray]:
    """Compute the curve of nominal stress over strain of a material in uniaxial tension and compression.

    Returns:
        Strains, ascending, shape (k,) [-], and nominal stresses (force over undeformed area), shape (k,) [Pa].
    """
    limits = _ELASTIC_STRAIN if material.small_strain_only else _RUBBER_STRAIN
    strain = np.linspace(*limits, _POINTS)
    return strain, compute_stress(material, strain)


def compute_stress(material: Material, strain: FloatArray) -> FloatArray:
    """Compute the nominal stress in uniaxial tension, without lateral stress.

    The stress is the derivative of the strain energy with respect to the stretch l = 1 + strain.  The lateral stretches
    are l^(-1/2) in incompressible rubber; in a compressible material they follow from its Poisson ratio and energy.

    Args:
        material: The material.
        strain: Strains above -1, shape (k,) [-].

    Returns:
        Nominal stresses, shape (k,) [Pa].
    """
    if material.small_strain_only:
        return material.youngs_modulus * strain
    stretch = 1 + strain
    stress, _ = measure_stress(material, np.log(stretch), np.array([1.0, -0.5, -0.5]))
    return stress / stretch


def write_curve(material: Material, path: Path) -> None:
    """Write the stress-strain curve of a material as a table, or draw it with the range of the modulus.

    Args:
        material: The material.
        path: A new file, .csv, .svg or .png.

    Raises:
        InputError: If the file exists or has another ending.
        MissingExtraError: If a picture is wanted and matplotlib is not installed.
        OSError: If the file cannot be written.
    """
    if path.suffix not in {".csv", ".svg", ".png"}:
        raise InputError(f"--out: {path} is none of .csv, .svg and .png; write for example --out {material.name}.csv")
    refuse_existing("--out", path)
    strain, stress = trace_stress(material)
    if path.suffix == ".csv":
        lines = [f"{x:.6g},{y:.6g}" for x, y in zip(strain.tolist(), stress.tolist(), strict=True)]
        write_text(path, "\n".join(["strain,nominal_stress_Pa", *lines]) + "\n")
        return
    require("matplotlib")
    low, high = (end / material.youngs_modulus for end in material.modulus_range)
    factor, unit = (1e-3, "kPa") if np.abs(stress).max() < 1e6 else (1e-6, "MPa")  # noqa: PLR2004
    with open_figure(path, width=COLUMN, height=2.6) as figure:
        axes = figure.subplots()
        strain, stress = 100 * strain, factor * stress
        axes.fill_between(
            strain, low * stress, high * stress, alpha=0.25, lw=0, color=COLOURS["fem"], label="range of sources"
        )
        axes.plot(strain, stress, color=COLOURS["fem"], label=f"{material.model} at the stated modulus")
        axes.axhline(0, color="grey", linewidth=0.6)
        axes.axvline(0, color="grey", linewidth=0.6)
        axes.set(xlabel="strain [%]", ylabel=f"nominal stress [{unit}]", title=f"{material.name}, uniaxial")
        axes.legend()
