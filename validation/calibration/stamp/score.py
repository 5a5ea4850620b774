"""Scores of the stamp recordings in one table: forward models, null models and the repeatability."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from fastmodel import Electronics
from fastmodel.signal.electronics import grey_levels
from meshes.array import FloatArray, TexelArray
from validation import metrics
from validation.calibration.stamp.case import WINDOW, StampCase, read_case
from validation.calibration.stamp.fit import StampFit, fit
from validation.calibration.stamp.forward_models import models
from validation.calibration.stamp.null_models import NULLS, Predictor
from validation.calibration.stamp.split import SPLITS, Split
from validation.campaign.pooling import Pooled, pool, skill
from validation.recordings.series import SOURCE, find_stamp_files
from validation.sensor_file import BUILT_IN, SensorDescription

#: Name of the built-in sensor whose array the recordings were made with.
DEFAULT_SENSOR = "sdh2-distal"


@dataclass(frozen=True, kw_only=True)
class CountScore:
    """Scores of a predicted mean frame against the recorded one, over active texels.

    Attributes:
        image_changed_percent: Mean grey difference over 255, with grey = round(255 counts / full scale) [%].
        pixels_changed: Texels whose grey level differs [-].
        relative_l2: Norm of the difference of counts over the norm of the recorded counts [-].
        total_counts_error: Difference of the sums over the recorded sum [-].
        centre_of_pressure_m: Distance of the centres of counts [m].
        wasserstein_m: Wasserstein-1 distance of the count maps, each scaled to unit mass [m].
        active_area_iou: Intersection over union of the areas above a tenth of the recorded peak [-].
    """

    image_changed_percent: float
    pixels_changed: float
    relative_l2: float
    total_counts_error: float
    centre_of_pressure_m: float
    wasserstein_m: float
    active_area_iou: float


@dataclass(frozen=True, kw_only=True)
class StampRow:
    """One model in one split.

    Attributes:
        split: Name of the split.
        model: Name of the model.
        kind: `model`, `null` or `floor` (repeatability).
        texel_gains: Whether a gain per texel was fitted.
        fitted: Names of the recordings that were fitted.
        parameters: The fitted parameters, by name with unit.
        per_case: Score of each scored weight (the mean over its repeats), by condition and letter.
        pooled: Mean over scored weights with its bootstrap interval, by metric.
        skill: 1 - image changed / image changed of a null model, by null model.
        electronics: The fitted load curve as electronics of the fast model; None for rows without one.
    """

    split: str
    model: str
    kind: str
    texel_gains: bool
    fitted: tuple[str, ...]
    parameters: Mapping[str, float]
    per_case: Mapping[str, CountScore]
    pooled: Mapping[str, Pooled]
    skill: Mapping[str, Pooled]
    electronics: Electronics | None


@dataclass(frozen=True, kw_only=True, eq=False)
class StampExample:
    """Images of one scored recording: the recorded one and the prediction of each model.

    Attributes:
        split: Name of the split.
        case: Name of the recording.
        load: Weight on the stamp [N].
        recorded: Grey levels, shape (rows, columns) [-].
        predicted: Grey levels by model, same shape [-].
    """

    split: str
    case: str
    load: float
    recorded: npt.NDArray[np.uint8]
    predicted: Mapping[str, npt.NDArray[np.uint8]]


@dataclass(frozen=True, kw_only=True, eq=False)
class StampScores:
    """All scores of a weight series.

    Attributes:
        rows: The table.
        examples: One scored recording per split.
        about: One line on each model and each split, by name.
        files: sha256 of each recording by its name.
        window: Times after the load was applied between which frames are averaged [s].
        noise: Root mean square over recordings of a texel's noise in the window [counts].
        source: Origin of the recordings.
    """

    rows: tuple[StampRow, ...]
    examples: tuple[StampExample, ...]
    about: Mapping[str, str]
    files: Mapping[str, str]
    window: tuple[float, float]
    noise: float
    source: str

    def row(self, split: str, model: str, *, texel_gains: bool = False) -> StampRow:
        """One row by name.

        Raises:
            KeyError: If there is none.
        """
        for row in self.rows:
            if (row.split, row.model, row.texel_gains) == (split, model, texel_gains):
                return row
        raise KeyError(f"no row {model!r} in split {split!r}; rows: {sorted({r.model for r in self.rows})}")


def score_recordings(
    folder: str | Path,
    sensor: SensorDescription | None = None,
    *,
    progress: Callable[[str], None] | None = None,
) -> StampScores:
    """Fit and score the weight series of a folder; it takes about ten seconds.

    Args:
        folder: The folder of the series, or one up to three levels above it.
        sensor: The sensor whose array was pressed; `sdh2-distal` when not given.  Its array and its `output_max` are
            used; cover and load curve are fitted.
        progress: Called with a line of text before each step.

    Raises:
        RecordingError: If there is no such series, a file is damaged, a weight is missing, or another array was
            pressed.
    """
    described = BUILT_IN[DEFAULT_SENSOR] if sensor is None else sensor
    array = described.array
    say = progress or (lambda _text: None)
    files = find_stamp_files(folder)
    say(f"reading {len(files)} recordings")
    cases = [read_case(file, array) for file in files]
    rows: list[StampRow] = []
    examples: list[StampExample] = []
    for split in SPLITS:
        fitted, scored = split.divide(cases)
        if not scored:
            continue
        table = _SplitTable(split, fitted, scored, described)
        table.add_nulls()
        table.add_repeats()
        for model in models(array):
            say(f"{split.about}: {model.name}")
            for found in fit(model, fitted, array, output_max=described.electronics.output_max):
                table.add_fit(model.name, found)
        rows += table.rows
        examples.append(table.make_example())
    return StampScores(
        rows=tuple(rows),
        examples=tuple(examples),
        about={model.name: model.about for model in models(array)} | {s.name: s.about for s in SPLITS},
        files={case.file.name: case.sha256 for case in cases},
        window=WINDOW,
        noise=float(np.sqrt(np.mean([case.noise**2 for case in cases]))),
        source=SOURCE,
    )


def score_counts(recorded: FloatArray, predicted: FloatArray, *, full_scale: int, array: TexelArray) -> CountScore:
    """Compare two frames of counts.

    Args:
        recorded: Counts, shape (n,) [-].
        predicted: Counts, shape (n,) [-].
        full_scale: Declared full scale of the recording [-].
        array: The texels.
    """
    r, p, places = recorded[array.active], predicted[array.active], array.centres[array.active]
    image = metrics.score_images(grey_levels(r, full_scale), grey_levels(p, full_scale))
    return CountScore(
        image_changed_percent=image.image_changed_percent,
        pixels_changed=float(image.pixels_changed),
        relative_l2=metrics.relative_l2(r, p),
        total_counts_error=float(abs(p.sum() - r.sum()) / r.sum()),
        centre_of_pressure_m=metrics.centre_of_pressure_error(r, p, places),
        wasserstein_m=metrics.wasserstein(r, p, places),
        active_area_iou=metrics.active_area_iou(r, p, threshold=metrics.AREA_THRESHOLD * float(r.max())),
    )


class _SplitTable:
    """The rows of one split, and the images of its heaviest scored recording."""

    def __init__(
        self,
        split: Split,
        fitted: Sequence[StampCase],
        scored: Sequence[StampCase],
        sensor: SensorDescription,
    ) -> None:
        self.rows: list[StampRow] = []
        self._split, self._fitted, self._scored, self._sensor = split, fitted, scored, sensor
        self._images: dict[str, npt.NDArray[np.uint8]] = {}
        self._shown = max(scored, key=lambda case: (case.file.letter, -case.file.repeat))

    def add_nulls(self) -> None:
        """Add the null models, fitted on the same recordings."""
        for name, make in NULLS.items():
            predict = make(self._fitted, self._sensor.electronics.output_max)
            self._add_row(name, self._score_cases(name, predict), kind="null")

    def add_repeats(self) -> None:
        """Add the difference between repeats of one weight, the noise floor of every model."""
        per_case: dict[str, list[CountScore]] = {}
        for first in self._scored:
            for second in self._scored:
                if first.file.weight == second.file.weight and first.file.repeat < second.file.repeat:
                    per_case.setdefault(first.file.weight, []).append(self._score(first, second.counts))
        if per_case:
            self._add_row("repeat of the same weight", per_case, kind="floor")

    def add_fit(self, name: str, found: StampFit) -> None:
        """Add a fitted model."""
        texel_gains = found.gains is not None
        label = f"{name}, texel gains" if texel_gains else name
        self._add_row(
            name,
            self._score_cases(label, found.counts),
            kind="model",
            texel_gains=texel_gains,
            parameters={**found.parameters(), "rms_counts": found.rms},
            electronics=found.load_curve.electronics(self._sensor.electronics.rate_hz, found.gains),
        )

    def make_example(self) -> StampExample:
        """Images of the heaviest scored recording."""
        return StampExample(
            split=self._split.name,
            case=self._shown.file.name,
            load=self._shown.file.load,
            recorded=self._grey_image(self._shown.counts),
            predicted=dict(self._images),
        )

    def _score_cases(self, label: str, predict: Predictor) -> dict[str, list[CountScore]]:
        """Scores of every scored weight by condition and letter; the shown image is kept under the label."""
        per_case: dict[str, list[CountScore]] = {}
        for case in self._scored:
            per_case.setdefault(case.file.weight, []).append(self._score(case, predict(case.file.load)))
        self._images[label] = self._grey_image(predict(self._shown.file.load))
        return per_case

    def _score(self, case: StampCase, predicted: FloatArray) -> CountScore:
        return score_counts(case.counts, predicted, full_scale=case.full_scale, array=self._sensor.array)

    def _grey_image(self, counts: FloatArray) -> npt.NDArray[np.uint8]:
        array = self._sensor.array
        grey = grey_levels(np.where(array.active, counts, 0.0), self._shown.full_scale)
        return grey.reshape(array.rows, array.columns)

    def _add_row(
        self,
        name: str,
        scores: Mapping[str, list[CountScore]],
        *,
        kind: str,
        texel_gains: bool = False,
        parameters: Mapping[str, float] = MappingProxyType({}),
        electronics: Electronics | None = None,
    ) -> None:
        per_case = {weight: _mean_score(each) for weight, each in scores.items()}
        nulls = [row for row in self.rows if row.kind == "null" and kind != "floor"]
        self.rows.append(
            StampRow(
                split=self._split.name,
                model=name,
                kind=kind,
                texel_gains=texel_gains,
                fitted=() if kind == "floor" else tuple(case.file.name for case in self._fitted),
                parameters=dict(parameters),
                per_case=per_case,
                pooled={metric: pool(list(values)) for metric, values in _by_metric(per_case.values())},
                skill={row.model: skill(_images_changed(per_case), _images_changed(row.per_case)) for row in nulls},
                electronics=electronics,
            )
        )


def _images_changed(per_case: Mapping[str, CountScore]) -> list[float]:
    return [score.image_changed_percent for score in per_case.values()]


def _mean_score(scores: Sequence[CountScore]) -> CountScore:
    """Mean over the repeats of one weight, which are not independent cases."""
    return CountScore(**{metric: float(np.mean(values)) for metric, values in _by_metric(scores)})


def _by_metric(scores: Iterable[CountScore]) -> Iterable[tuple[str, tuple[float, ...]]]:
    """The values of every score, metric by metric."""
    table = [asdict(score) for score in scores]
    return [(metric, tuple(row[metric] for row in table)) for metric in table[0]]
