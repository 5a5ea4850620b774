"""Scores of the stamp recordings: the fast model, other forwards, null models and the repeatability, in one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fastmodel import Electronics
from fastmodel.signal.electronics import grey_levels
from meshes import TexelArray
from validation import metrics
from validation.calibration.stamp.case import WINDOW, StampCase, read_case
from validation.calibration.stamp.fit import StampFit, fit
from validation.calibration.stamp.forward_models import models
from validation.calibration.stamp.null_models import NULLS, Predictor
from validation.calibration.stamp.split import SPLITS, Split
from validation.campaign.pooling import Pooled, pool, skill
from validation.recordings.series import SOURCE, find_stamp_series
from validation.sensor_file import BUILT_IN, SensorDescription

FloatArray = npt.NDArray[np.float64]

#: The sensor of the recordings.
DEFAULT_SENSOR = "sdh2-distal"


@dataclass(frozen=True, kw_only=True)
class CountScore:
    """One predicted mean frame against the recorded one; masked texels do not count.

    Attributes:
        image_changed_percent: With grey = round(255 counts / full scale) [%].
        pixels_changed: Grey levels that differ [-].
        relative_l2: Of counts [-].
        total_counts_error: Difference of the sums over the recorded sum [-].
        centre_of_pressure_m: Distance of the centres of counts [m].
        wasserstein_m: Of the unit-mass count maps [m].
        active_area_iou: At a tenth of the recorded peak [-].
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
        parameters: What was fitted, by name with its unit.
        per_case: Score of each scored weight (the mean over its repeats), by condition and letter.
        pooled: Mean over scored weights with its bootstrap interval, by metric.
        skill: 1 - image changed / that of a null model, by null model.
        electronics: The fitted load curve for the fast model; None for rows without one.
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
    """Images of one scored recording: the recorded one and what each model predicted.

    Attributes:
        split: Name of the split.
        case: Name of the recording.
        load: Weight [N].
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
        about: What each model and each split is, by name.
        files: sha256 of each recording by its name.
        window: The steady frame is the mean over this time after the load came on [s].
        noise: Root mean square over recordings of a texel's noise in the window [counts].
        source: Where the recordings come from.
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
    """Fit and score the weight series of a folder, about ten seconds.

    Args:
        folder: Where the series is, or up to three levels above it.
        sensor: The sensor whose array was pressed; `sdh2-distal` when not given.  Its array and the largest count
            of its electronics are used; cover and load curve are fitted.
        progress: Called with a line of text before each step.

    Raises:
        RecordingError: If there is no such series, a file is damaged, a weight is missing, or the pressed array is
            not the sensor's.
    """
    described = BUILT_IN[DEFAULT_SENSOR] if sensor is None else sensor
    array = described.array
    say = progress or (lambda _text: None)
    series = find_stamp_series(folder)
    say(f"reading {len(series.files)} recordings")
    cases = [read_case(file, array) for file in series.files]
    rows: list[StampRow] = []
    examples: list[StampExample] = []
    for split in SPLITS:
        fitted, scored = split.divide(cases)
        if not scored:
            continue
        made = _Scorer(split, fitted, scored, described)
        made.nulls()
        made.floor()
        for model in models(array):
            say(f"{split.about}: {model.name}")
            plain, gained = fit(model, fitted, array, output_max=described.electronics.output_max)
            made.model(model.name, plain)
            made.model(model.name, gained)
        rows += made.rows
        examples.append(made.example())
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


class _Scorer:
    """Collects the rows of one split."""

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

    def nulls(self) -> None:
        """The null models, fitted on the same recordings."""
        for name, make in NULLS.items():
            self._predictor(name, make(self._fitted, self._sensor.electronics.output_max), kind="null")

    def floor(self) -> None:
        """How far repeats of one weight are apart: no model can be told better than that."""
        per_case: dict[str, list[CountScore]] = {}
        for first in self._scored:
            for second in self._scored:
                if first.file.weight == second.file.weight and first.file.repeat < second.file.repeat:
                    per_case.setdefault(first.file.weight, []).append(self._score(first, second.counts))
        if per_case:
            self._add("repeat of the same weight", per_case, kind="floor")

    def model(self, name: str, found: StampFit) -> None:
        """A fitted model."""
        gained = found.gains is not None
        electronics = found.load_curve.electronics(self._sensor.electronics.rate_hz, found.gains)
        parameters = {**found.parameters(), "rms_counts": found.rms}
        self._predictor(name, found.counts, kind="model", gains=gained, more=(parameters, electronics))

    def example(self) -> StampExample:
        """The heaviest scored recording."""
        return StampExample(
            split=self._split.name,
            case=self._shown.file.name,
            load=self._shown.file.load,
            recorded=self._grey(self._shown.counts),
            predicted=dict(self._images),
        )

    def _predictor(
        self,
        name: str,
        predict: Predictor,
        *,
        kind: str,
        gains: bool = False,
        more: tuple[Mapping[str, float], Electronics | None] = ({}, None),
    ) -> None:
        per_case: dict[str, list[CountScore]] = {}
        for case in self._scored:
            scores = per_case.setdefault(case.file.weight, [])
            scores.append(self._score(case, predict(case.file.load)))
        self._images[f"{name}, texel gains" if gains else name] = self._grey(predict(self._shown.file.load))
        self._add(name, per_case, kind=kind, gains=gains, more=more)

    def _score(self, case: StampCase, predicted: FloatArray) -> CountScore:
        return score_counts(case.counts, predicted, full_scale=case.full_scale, array=self._sensor.array)

    def _grey(self, counts: FloatArray) -> npt.NDArray[np.uint8]:
        array = self._sensor.array
        grey = grey_levels(np.where(array.active, counts, 0.0), self._shown.full_scale)
        return grey.reshape(array.rows, array.columns)

    def _add(
        self,
        name: str,
        scores: Mapping[str, list[CountScore]],
        *,
        kind: str,
        gains: bool = False,
        more: tuple[Mapping[str, float], Electronics | None] = ({}, None),
    ) -> None:
        per_case = {weight: _mean(each) for weight, each in scores.items()}
        changed = [score.image_changed_percent for score in per_case.values()]
        nulls = [row for row in self.rows if row.kind == "null" and kind != "floor"]
        self.rows.append(
            StampRow(
                split=self._split.name,
                model=name,
                kind=kind,
                texel_gains=gains,
                fitted=() if kind == "floor" else tuple(case.file.name for case in self._fitted),
                parameters=more[0],
                per_case=per_case,
                pooled={metric: pool(list(values)) for metric, values in _columns(per_case.values())},
                skill={
                    row.model: skill(changed, [s.image_changed_percent for s in row.per_case.values()]) for row in nulls
                },
                electronics=more[1],
            )
        )


def _mean(scores: Sequence[CountScore]) -> CountScore:
    """Repeats of a weight are not independent cases: their mean is one case."""
    return CountScore(**{metric: float(np.mean(values)) for metric, values in _columns(scores)})


def _columns(scores: Iterable[CountScore]) -> Iterable[tuple[str, tuple[float, ...]]]:
    table = [asdict(score) for score in scores]
    return [(metric, tuple(row[metric] for row in table)) for metric in table[0]]
