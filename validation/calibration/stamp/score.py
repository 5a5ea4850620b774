"""Scores forward models, null models and the repeatability on recordings of the stamp, in one table."""

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

#: Name of the built-in sensor whose array was pressed in the recordings of the stamp.
DEFAULT_SENSOR = "sdh2-distal"


@dataclass(frozen=True, kw_only=True)
class CountScore:
    """Differences between a predicted and a recorded mean frame of counts, over active texels.

    Attributes:
        image_changed_percent: Mean absolute difference of grey levels over 255, where the grey level is
            round(255 counts / full scale) [%].
        pixels_changed: Number of texels whose grey levels differ [-].
        relative_l2: Euclidean norm of the difference of counts over that of the recorded counts [-].
        total_counts_error: Absolute difference of the sums of counts over the recorded sum [-].
        centre_of_pressure_m: Distance between the centres of predicted and recorded counts [m].
        wasserstein_m: Wasserstein-1 distance of the two maps of counts, each scaled to unit mass [m].
        active_area_iou: Intersection over union of the areas with counts above a tenth of the largest recorded
            count [-].
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
    """Row of the table of scores: one model on one split of the recordings into fitted and scored ones.

    Attributes:
        split: Name of the split.
        model: Name of the model.
        kind: `model` (forward model), `null` (null model) or `floor` (repeatability of the recordings).
        texel_gains: Whether a gain per texel was fitted.
        fitted: Names of the recordings that the model was fitted to.
        parameters: The fitted parameters, by name with unit.
        per_case: Score of each scored weight, the mean over its repeated recordings, by condition and letter.
        pooled: Mean score over the scored weights with its bootstrap interval, by metric.
        skill: 1 - (changed grey of this model) / (changed grey of a null model), by name of the null model [-].
        electronics: The fitted load curve as electronics of the fast model; None for rows without a load curve.
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
    """Tactile images of one scored recording: the recorded image and the image that each model predicts.

    Attributes:
        split: Name of the split of the recordings into fitted and scored ones.
        case: Name of the recording.
        load: Weight on the stamp [N].
        recorded: Grey levels of the recorded mean frame, shape (rows, columns) [-].
        predicted: Predicted grey levels by name of the model, each of shape (rows, columns) [-].
    """

    split: str
    case: str
    load: float
    recorded: npt.NDArray[np.uint8]
    predicted: Mapping[str, npt.NDArray[np.uint8]]


@dataclass(frozen=True, kw_only=True, eq=False)
class StampScores:
    """All scores on a series of recordings of the stamp under known weights.

    Attributes:
        rows: Rows of the table of scores, one per split and model.
        examples: Images of one scored recording per split.
        about: Description of each model and each split in one line, by name.
        files: SHA-256 hash of each recording, by name of the recording.
        window: First and last time after the load was applied between which frames are averaged [s].
        noise: Root mean square over recordings of the standard deviation of a texel's counts in `window` [counts].
        source: Where the recordings were published.
    """

    rows: tuple[StampRow, ...]
    examples: tuple[StampExample, ...]
    about: Mapping[str, str]
    files: Mapping[str, str]
    window: tuple[float, float]
    noise: float
    source: str

    def row(self, split: str, model: str, *, texel_gains: bool = False) -> StampRow:
        """Return the row of a model on a split, with or without texel gains.

        Raises:
            KeyError: If the table has no such row.
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
    """Fit models to recordings of the stamp under known weights, and score them; this takes about ten seconds.

    Args:
        folder: The folder with the recordings, or a folder up to three levels above it.
        sensor: The sensor whose array was pressed; `sdh2-distal` when not given.  The array and `output_max` of this
            sensor are used; cover and load curve are fitted.
        progress: Function that is called with a line of text before each step.

    Raises:
        RecordingError: If the folder holds no such recordings, a file is damaged, a weight is missing, or another array
            was pressed.
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
    """Compare a predicted frame of counts with the recorded frame by every metric, over active texels.

    Args:
        recorded: Recorded counts of the n texels, shape (n,) [-].
        predicted: Predicted counts, shape (n,) [-].
        full_scale: Largest count as stated in the recording, which becomes white [-].
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
    """Builds the rows of the table for one split, and the images of the heaviest scored recording."""

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
        """Add a row for each null model, fitted to the same recordings as the models."""
        for name, make in NULLS.items():
            predict = make(self._fitted, self._sensor.electronics.output_max)
            self._add_row(name, self._score_cases(name, predict), kind="null")

    def add_repeats(self) -> None:
        """Add a row with the differences between repeated recordings of one weight, if there are any.

        These differences are the smallest error that any model can be expected to reach.
        """
        per_case: dict[str, list[CountScore]] = {}
        for first in self._scored:
            for second in self._scored:
                if first.file.weight == second.file.weight and first.file.repeat < second.file.repeat:
                    per_case.setdefault(first.file.weight, []).append(self._score(first, second.counts))
        if per_case:
            self._add_row("repeat of the same weight", per_case, kind="floor")

    def add_fit(self, name: str, found: StampFit) -> None:
        """Add a row for the forward model `name` with the fitted parameters `found`."""
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
        """Return the recorded and predicted images of the heaviest scored recording."""
        return StampExample(
            split=self._split.name,
            case=self._shown.file.name,
            load=self._shown.file.load,
            recorded=self._grey_image(self._shown.counts),
            predicted=dict(self._images),
        )

    def _score_cases(self, label: str, predict: Predictor) -> dict[str, list[CountScore]]:
        """Score a prediction on every scored recording, and store its image for the example under `label`.

        Returns:
            Scores of all repeats of each weight, by condition and letter.
        """
        per_case: dict[str, list[CountScore]] = {}
        for case in self._scored:
            per_case.setdefault(case.file.weight, []).append(self._score(case, predict(case.file.load)))
        self._images[label] = self._grey_image(predict(self._shown.file.load))
        return per_case

    def _score(self, case: StampCase, predicted: FloatArray) -> CountScore:
        """Compare predicted counts of the n texels, shape (n,), with the mean counts of one recording."""
        return score_counts(case.counts, predicted, full_scale=case.full_scale, array=self._sensor.array)

    def _grey_image(self, counts: FloatArray) -> npt.NDArray[np.uint8]:
        """Convert counts, shape (n,), to grey levels, shape (rows, columns); masked texels are black."""
        array = self._sensor.array
        grey = grey_levels(np.where(array.active, counts, 0.0), self._shown.full_scale)
        return np.asarray(grey).reshape(array.rows, array.columns)

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
    """Average the scores of repeated recordings of one weight, because repeats are not independent cases."""
    return CountScore(**{metric: float(np.mean(values)) for metric, values in _by_metric(scores)})


def _by_metric(scores: Iterable[CountScore]) -> Iterable[tuple[str, tuple[float, ...]]]:
    """Regroup scores by metric: return pairs of the name of a metric and its values in all scores."""
    table = [asdict(score) for score in scores]
    return [(metric, tuple(row[metric] for row in table)) for metric in table[0]]
