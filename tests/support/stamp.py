"""Stamp recordings that are made of known models."""

from pathlib import Path

import numpy as np

from meshes.catalogue import ARRAYS
from validation.calibration.stamp.case import StampCase
from validation.calibration.stamp.forward_models import models, uniform
from validation.calibration.stamp.load_curve import LoadCurve
from validation.recordings.series import StampFile

ARRAY = ARRAYS["sdh2-distal"]
OUTPUT_MAX = 3512
CURVE = LoadCurve(sensitivity=6000.0, dead_force=0.05, saturation_band=2000.0, output_max=OUTPUT_MAX)


def file_of(letter, repeat=1, condition="room"):
    path = Path(condition) / f"{letter}{repeat}.dsa"
    return StampFile(path=path, condition=condition, letter=letter, repeat=repeat)


def case_of(letter, counts, repeat=1, condition="room"):
    return StampCase(
        file=file_of(letter, repeat, condition),
        counts=np.asarray(counts, dtype=float),
        noise=0.0,
        full_scale=4095,
        onset=0.0,
        sha256="",
    )


def by_name(name):
    return next(model for model in models(ARRAY) if model.name == name)


def synthetic(shape, letters="ACEG", gains=1.0, noise=0.0, curve=CURVE):
    forces = uniform(ARRAY, (0.0, 0.0)).texel_forces(np.array(shape))
    rng = np.random.default_rng(2)
    cases = []
    for letter in letters:
        counts = curve.counts(file_of(letter).load * forces, gains)
        cases.append(case_of(letter, np.where(counts > 0, np.maximum(counts + rng.normal(0, 1, 78) * noise, 0), 0)))
    return cases
