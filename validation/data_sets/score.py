"""Scores the forward model, null models and the repeatability on the recordings of a data set, in one table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from glob import escape
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from fastmodel import Electronics, Parameters
from fastmodel.signal.electronics import grey_levels
from meshes.array_types import FloatArray
from validation.calibration.cross_validation import POWERS, choose_options
from validation.calibration.forward_fit import ForwardFit, Options, borrow_poses, fit_forward
from validation.calibration.model import (
    ContactMethod,
    make_fast_method,
    make_reference_method,
)
from validation.calibration.uncertainty import describe_fit
from validation.campaign.campaign_file import Inputs
from validation.credibility.recorded import compare_loads
from validation.credibility.uncertainty import ComparisonError
from validation.data_sets.data_set import DataSet
from validation.data_sets.images import NUMBERS, Image, observe, read_images
from validation.data_sets.nulls import NULLS
from validation.data_sets.results import (
    CountScore,
    RecordingExample,
    RecordingRow,
    RecordingScores,
    compare_with_nulls,
    group_by_metric,
    score_counts,
)
from validation.errors import InputError
from validation.pooling import pool, skill
from validation.schema.data_set import SelectionTable, SplitTable
from validation.sensor_file import SensorDescription

#: Name of the fast model by its default contact method in tables.
FAST = "fast model"
#: Largest number of faulty recordings that an error message lists if no recording can be used [-].
_MOST_LINES = 5


def score_recordings(
    data_set: DataSet,
    sensor: SensorDescription,
    parameters: Parameters,
    *,
    inputs: Inputs | None = None,
    progress: Callable[[str], None] | None = None,
) -> RecordingScores:
    """Fit models to recordings under known loads, and score them on others; this takes seconds per split.

    Args:
        data_set: The recordings and the splits.
        sensor: The sensor that made the recordings: its array, its cover and its largest count.
        parameters: Parameters of its fast model.
        inputs: Standard uncertainties of cover and pose; None for the defaults.
        progress: Function that is called with a line of text before each step.

    Raises:
        InputError: If no recording can be used, or no split.
    """
    say = progress or (lambda _text: None)
    say(f"reading {len(data_set.files)} recordings")
    images, faults = read_images(data_set, sensor.array)
    problems = [*data_set.problems, *faults]
    if not images:
        more = [f"and {len(problems) - _MOST_LINES} more"] if len(problems) > _MOST_LINES else []
        origin = f"; they are of {data_set.sensor}" if data_set.sensor else ""
        raise InputError(*problems[:_MOST_LINES], *more, f"{data_set.name}: no recording can be used{origin}")
    methods = list_methods(sensor, parameters)
    tables: list[_SplitTable] = []
    for split in propose_splits(images) if data_set.splits is None else data_set.splits:
        try:
            table = _SplitTable(split, images, sensor)
            table.add_nulls()
            table.add_repeats()
            for name, method in methods.items():
                say(f"{split.about or split.name}: {name}")
                table.add_model(name, method)
        except InputError as error:
            problems += error.faults
        except ValueError as error:
            problems.append(f"split '{split.name}': {error}; it is left out")
        else:
            tables.append(table)
    if not tables:
        remedy = "write a [[split]] with fit and score, or record loads that differ by more than 5 % in a series"
        raise InputError(*problems, f"{data_set.name}: no split can be scored; {remedy}")
    return RecordingScores(
        name=data_set.name,
        rows=tuple(row for table in tables for row in table.rows),
        examples=tuple(table.example for table in tables),
        about={name: method.about for name, method in methods.items()}
        | {table.split.name: table.split.about or table.split.name for table in tables},
        notes={table.split.name: (compare_with_nulls(table.rows), *table.notes) for table in tables},
        files={image.file.name: image.sha256 for image in images},
        noise=float(np.sqrt(np.mean([image.noise**2 for image in images]))),
        source=data_set.source,
        problems=tuple(problems),
        errors={table.split.name: table.compare(inputs or Inputs()) for table in tables},
        left_out={table.split.name: table.left_out for table in tables},
    )


def propose_splits(images: Sequence[Image]) -> tuple[SplitTable, ...]:
    """Return the splits for a data set that names none.

    Series that may only be scored are predicted from series that may be fitted.  Without such series, the heavier half
    of the loads of each series is predicted from the lighter half; the load of a recording whose load varies is its
    largest one.

    Args:
        images: Images of all recordings.
    """
    fitted = list(dict.fromkeys(image.file.series for image in images if "fit" in image.file.uses))
    scored = list(dict.fromkeys(image.file.series for image in images if image.file.uses == ("score",)))
    if scored:
        about = f"{', '.join(fitted)} to {', '.join(scored)}"
        fit, score = (tuple(SelectionTable(series=name) for name in side) for side in (fitted, scored))
        return (SplitTable.model_construct(name="other series", about=about, fit=fit, score=score),) if fitted else ()
    splits = []
    for series in fitted:
        loads: dict[str, float] = {}
        for image in images:
            if image.file.series == series:
                loads[image.file.path.name] = max(image.load, loads.get(image.file.path.name, 0.0))
        different = [b for a, b in pairwise([0.0, *sorted(loads.values())]) if b > NUMBERS.same_load * a]
        if len(different) > 1:
            least = different[len(different) // 2]
            chosen = ([escape(name) for name in loads if (loads[name] >= least) == heavy] for heavy in (False, True))
            light, heavy = (SelectionTable.model_construct(series=series, files=tuple(names)) for names in chosen)
            about = f"{series}: light loads to heavy ones"
            split = SplitTable.model_construct(name=f"{series} heavier", about=about, fit=(light,), score=(heavy,))
            splits.append(split)
    return tuple(splits)


def list_methods(sensor: SensorDescription, parameters: Parameters) -> dict[str, ContactMethod]:
    """Return the contact methods that are scored, by name: the fast model's default, its boxes, finite elements."""
    methods = {FAST: make_fast_method(parameters)}
    if parameters.surface is not None:
        methods[f"{FAST}, boxes"] = make_fast_method(parameters, "boxes")
    methods["reference"] = make_reference_method(sensor.layered_cover, sensor.array)
    return methods


class _SplitTable:
    """Builds the rows of the table for one split, and the images of the heaviest scored recording."""

    def __init__(self, split: SplitTable, images: Sequence[Image], sensor: SensorDescription) -> None:
        """Divide the images into fitted, placing and scored ones.

        Raises:
            InputError: If a group is empty, a recording is in two groups, or a pose is unknown.
        """
        self.split, self._sensor = split, sensor
        self.rows: list[RecordingRow] = []
        self.notes: tuple[str, ...] = ()
        self._fitted, self._placed, self._scored = (
            [
                image
                for image in images
                if any(each.takes(image.file.series, image.file.path.name, image.load) for each in side)
            ]
            for side in (split.fit, split.place, split.score)
        )
        _check_sides(split, self._fitted, self._placed, self._scored)
        self._observed = observe(self._fitted)
        self._images: dict[str, npt.NDArray[np.uint8]] = {}
        self._shown = max(self._scored, key=lambda image: image.load)
        self._options: Options | None = None
        self._chosen = ""
        self.left_out: dict[str, tuple[float, ...]] = {}
        self._fast: ForwardFit | None = None

    @property
    def example(self) -> RecordingExample:
        """The recorded and predicted images of the heaviest scored recording."""
        shown = self._shown
        recorded = self._grey_image(shown.counts)
        return RecordingExample(
            split=self.split.name, case=shown.file.name, load=shown.load, recorded=recorded, predicted=self._images
        )

    def add_nulls(self) -> None:
        """Add a row for each null model, fitted to the same recordings as the models."""
        placed = observe(self._placed) if self._placed else None
        scored, output_max = observe(self._scored), float(self._sensor.electronics.output_max)
        for name, null in NULLS.items():
            if null.applies(self._observed, placed):
                counts = null.fit(self._observed, placed, output_max)(scored)
                self._add_row(name, self._score_cases(name, counts), kind="null")

    def add_repeats(self) -> None:
        """Add rows with the differences between repeated recordings of one load, if there are any.

        These differences are the smallest error that a model can be expected to reach.  In the second row, the later
        recording is scaled to the sum of the earlier one.  Creep and warming multiply all texels by one factor, so that
        the remaining difference is scatter.
        """
        plain: dict[str, list[CountScore]] = {}
        scaled: dict[str, list[CountScore]] = {}
        for number, first in enumerate(self._scored):
            for second in self._scored[number + 1 :]:
                if first.case == second.case and first.file.path != second.file.path:
                    ratio = first.counts.sum() / max(float(second.counts.sum()), 1e-9)
                    plain.setdefault(first.case, []).append(self._score(first, second.counts))
                    scaled.setdefault(first.case, []).append(self._score(first, ratio * second.counts))
        for name, scores in (("repeat of the same load", plain), ("repeat, scaled to the same sum", scaled)):
            if scores:
                self._add_row(name, scores, kind="floor")

    def add_model(self, name: str, method: ContactMethod) -> None:
        """Add rows for the forward model with a contact method: without gains and heights of texels, and with them.

        The model is fitted to the fitted recordings.  The poses of the scored placements are fitted to the placing
        recordings.
        """
        electronics, scored, shown = self._sensor.electronics, observe(self._scored), self._shown
        if self._options is None:
            # A seating height belongs to the seat of the indenter and does not apply to another placement.
            seats = {image.file.placement.name for image in self._fitted}
            seated = all(image.file.placement.name in seats for image in self._scored)
            options = Options(output_max=float(electronics.output_max), heights=seated, sessions=True)
            self._options, errors = choose_options(method, self._observed, options, scored)
            listed = "; ".join(f"{seat} {', '.join(f'{each:.0f}' for each in of)}" for seat, of in errors.items())
            powers = f"weights by the load to the power {', '.join(f'{power:g}' for power in POWERS)}"
            self._chosen = f"error of left-out fitted images [counts], {powers}: {listed or 'none could be left out'}"
            self.left_out = errors
        options = self._options
        for chosen in (replace(options, gains=False, heights=False), options):
            found: ForwardFit = fit_forward(method, observe([*self._fitted, *self._placed]), chosen)
            found, borrowed = borrow_poses(found, scored)
            self._add_row(
                name,
                self._score_cases(f"{name}, texel gains" if chosen.gains else name, found.predict(scored)),
                kind="model",
                texel_gains=chosen.gains,
                parameters=found.parameters(),
                electronics=found.curve.electronics(
                    electronics.rate_hz, temperature=shown.temperature, age=shown.age, threshold=shown.threshold
                ),
            )
        if name == FAST:
            self._fast = found
            self.notes = (*borrowed, self._chosen, *describe_fit(found))

    def compare(self, inputs: Inputs) -> tuple[ComparisonError, ...]:
        """Compare the fast model with texel gains with the scored recordings, with the validation uncertainty."""
        if self._fast is None:
            return ()
        return tuple(compare_loads(self._fast, self._scored, self._sensor.layered_cover, inputs))

    def _score_cases(self, label: str, counts: FloatArray) -> dict[str, list[CountScore]]:
        """Score predicted counts of all scored images, shape (k, n), and store the image of the example under `label`.

        Returns:
            Scores of all repeats of each case, by name.
        """
        per_case: dict[str, list[CountScore]] = {}
        for image, predicted in zip(self._scored, counts, strict=True):
            per_case.setdefault(image.case, []).append(self._score(image, predicted))
            if image is self._shown:
                self._images[label] = self._grey_image(predicted)
        return per_case

    def _score(self, image: Image, predicted: FloatArray) -> CountScore:
        """Compare predicted counts of the n texels, shape (n,), with one recorded image."""
        full_scale, array = image.full_scale, self._sensor.array
        return score_counts(image.counts, predicted, full_scale=full_scale, array=array, measured=image.measured)

    def _grey_image(self, counts: FloatArray) -> npt.NDArray[np.uint8]:
        """Convert counts, shape (n,), to grey levels, shape (rows, columns); texels that do not measure are black."""
        grey = grey_levels(np.where(self._shown.measured, counts, 0.0), self._shown.full_scale)
        return np.asarray(self._sensor.array.image(np.asarray(grey)))

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
        """Add a row; repeats of one case are averaged, because they are not independent cases."""
        per_case = {
            case: CountScore(**{metric: float(np.mean(values)) for metric, values in group_by_metric(each).items()})
            for case, each in scores.items()
        }
        changed = [score.image_changed_percent for score in per_case.values()]
        nulls = [row for row in self.rows if row.kind == "null" and kind != "floor"]
        self.rows.append(
            RecordingRow(
                split=self.split.name,
                model=name,
                kind=kind,
                texel_gains=texel_gains,
                fitted=() if kind == "floor" else tuple(image.file.name for image in (*self._fitted, *self._placed)),
                parameters=dict(parameters),
                per_case=per_case,
                pooled={metric: pool(list(values)) for metric, values in group_by_metric(per_case.values()).items()},
                skill={
                    row.model: skill(changed, [score.image_changed_percent for score in row.per_case.values()])
                    for row in nulls
                },
                electronics=electronics,
            )
        )


def _check_sides(split: SplitTable, fitted: Sequence[Image], placed: Sequence[Image], scored: Sequence[Image]) -> None:
    """Check that no group of a split is empty and that no recording is in two groups.

    Raises:
        InputError: If a group is empty or a recording is in two groups.
    """
    fault = ""
    for side, found in (("score", scored), ("place", placed), ("fit", fitted)):
        if not found and (side != "place" or split.place):
            fault = f"no usable recording to {side}"
    names = {image.sha256: image.file.name for image in (*scored, *placed)}
    of_fit, of_place, of_score = ({image.sha256 for image in side} for side in (fitted, placed, scored))
    if not fault and (both := of_fit & of_place):
        fault = f"{names[both.pop()]} is fitted and placed; expected one of the two"
    if not fault and (seen := sorted({names[each] for each in of_score & (of_fit | of_place)})):
        fault = (
            f"{', '.join(seen[:3])}{' and others' if seen[3:] else ''} would be scored, and is fitted or placed too; a "
            "recording that was fitted is never scored"
        )
    if fault:
        raise InputError(f"split {split.name!r}: {fault}; it is left out")
