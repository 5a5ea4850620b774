"""Scores creep on held-out weights: c is fitted on some weights, and the late image of the others is predicted.

    python benchmarks/creep_scores.py --recordings DIR

The image 2 s to 3 s after loading is turned into forces on the texels, which are held in the chain of the fast model
until the middle of the late window, with creep and without.  c is the mean of the coefficients that the reading of
recordings measures, as `softcover calibrate` writes it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fastmodel
from fastmodel import ChainFunctions, Electronics, Parameters
from fastmodel.signal.creep import REFERENCE_TIME
from fastmodel.signal.electronics import grey_levels
from meshes.array_types import FloatArray
from validation.calibration.uncertainty import Estimate, predict_mean
from validation.data_sets.data_set import DataSet, find_data_set
from validation.data_sets.images import Image, read_images
from validation.metrics import score_images

#: Windows of the early and of the late image after loading [s].
EARLY, LATE = (2.0, 3.0), (7.0, 8.8)
#: Names of the weights of each split, of which the others are scored: every other weight, and light or heavy ones.
SPLITS = {"every other": "ACEG", "others": "BDFH", "light": "ABCD", "heavy": "EFGH"}
#: Counts per newton of the chain, which cancels [1/N].
SENSITIVITY = 1000.0


class Scores(NamedTuple):
    """Scores of the late images of the weights that were not fitted.

    Attributes:
        creep: Fitted c with its interval.
        others: Smallest and largest mean c of a scored weight [-].
        images: Image changed in percent, with creep and without, shape (k, 2).
        sums: Difference of the sums over the late one, with creep and without, shape (k, 2) [-].
    """

    creep: Estimate
    others: tuple[float, float]
    images: FloatArray
    sums: FloatArray


def read_pairs(data_set: DataSet) -> list[tuple[Image, Image]]:
    """Read the early and the late image of each recording that has both."""
    parameters, found = fastmodel.load(data_set.sensor), []
    for window in (EARLY, LATE):
        files = tuple(replace(file, window=window) for file in data_set.files)
        images, _ = read_images(replace(data_set, files=files), parameters.array)
        found.append({image.sha256: image for image in images if window[0] < image.age < window[1]})
    return [(found[0][key], found[1][key]) for key in found[0] if key in found[1]]


def predict(parameters: Parameters, early: Image, late: Image, creep: float) -> FloatArray:
    """Predict the counts of a late image from an early one, through the chain of the fast model, shape (n,) [-]."""
    electronics = Electronics(
        rate_hz=parameters.electronics.rate_hz, sensitivity=SENSITIVITY, threshold=early.threshold, creep=creep,
        output_max=late.full_scale,
    )  # fmt: skip
    rate = 10 * electronics.rate_hz
    functions = ChainFunctions(replace(parameters, electronics=electronics, filter=None), rate, spreads=False)
    grown = 1 + creep * np.log(early.age / REFERENCE_TIME)
    lit = early.measured & (early.counts > early.floor)
    forces = np.where(lit, (early.counts + early.threshold) / SENSITIVITY / grown, 0.0)
    held = round((late.age - REFERENCE_TIME) * electronics.rate_hz)
    return np.asarray(functions.frame(functions.settle(forces), frames=held)[1].counts, dtype=np.float64)


def score(parameters: Parameters, pairs: Sequence[tuple[Image, Image]], fitted: str) -> Scores:
    """Fit c on the weights with the given letters, and score the others.

    Args:
        parameters: Parameters of the sensor.
        pairs: Early and late image of each recording.
        fitted: Letters with which the names of the fitted recordings begin.
    """
    mine = np.array([late.file.path.name[0] in fitted for _, late in pairs])
    creeps, loads = (np.array([getattr(late, name) for _, late in pairs]) for name in ("creep", "load"))
    creep = predict_mean(creeps[mine], loads[mine], "-")
    if creep is None:
        raise ValueError(f"fewer than three recordings of the weights {fitted} hold a load long enough for creep")
    others = [float(np.nanmean(creeps[loads == load])) for load in np.unique(loads[~mine])]
    images, sums = [], []
    for own, (early, late) in zip(mine, pairs, strict=True):
        if own:
            continue
        found = [predict(parameters, early, late, c) for c in (creep.value, 0.0)]
        greys = [grey_levels(each, late.full_scale) for each in (late.counts, *found)]
        images.append([score_images(greys[0], grey, active=late.measured).image_changed_percent for grey in greys[1:]])
        sums.append([abs(each[late.measured].sum() / late.total - 1) for each in found])
    return Scores(creep, (min(others), max(others)), np.array(images), np.array(sums))


def main() -> None:
    """Score all splits and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=Path, required=True)
    data_set = find_data_set(parser.parse_args().recordings)
    pairs, parameters = read_pairs(data_set), fastmodel.load(data_set.sensor)
    print("fitted       scored  c      interval        c of the others  image changed [%]  sum off [%]  largest")
    print("                                                              creep  none        creep  none  creep")
    for name, letters in SPLITS.items():
        found = score(parameters, pairs, letters)
        image, total = found.images.mean(axis=0), 100 * found.sums.mean(axis=0)
        print(
            f"{name:12} {len(found.images):<7} {found.creep.value:.4f} {found.creep.low:.4f}..{found.creep.high:.4f}  "
            f"{found.others[0]:.4f}..{found.others[1]:.4f}   {image[0]:<6.2f} {image[1]:<11.2f} {total[0]:<6.1f} "
            f"{total[1]:<5.1f} {100 * found.sums[:, 0].max():.1f}"
        )


if __name__ == "__main__":
    main()
