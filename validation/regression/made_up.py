"""Experiments of the regression check on made-up recordings and scores, which are the same for all sensors.

The recordings are those of a stamp on 6 x 5 texels of 4 mm, one of them masked, written and read as CSV files: two
placements, six loads in each, one of them twice, three temperatures, creep, a zero and a gain per texel, and a
threshold.  Nothing in them is random.  They are computed by formulas of their own, so that a change of the fast model
shows in scores and fits.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.special import ndtr

from fastmodel import Parameters
from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.calibration.calibrate import calibrate
from validation.calibration.model import make_fast_method
from validation.campaign.campaign_file import Campaign, Criterion, Inputs
from validation.campaign.case import Case
from validation.campaign.results import CampaignResult, CaseResult, Reference, predict
from validation.data_sets.data_set import DataSet, build_data_set
from validation.data_sets.images import observe, read_images
from validation.data_sets.results import find_difference
from validation.data_sets.score import score_recordings
from validation.recordings import tables
from validation.recordings.recording import Recording, Setup, make_array
from validation.regression.experiments import make_oblong
from validation.regression.reading import Reading, Readings, Subject, find_unit, list_numbers, list_rows, read
from validation.schema import read as read_tables
from validation.schema.campaign import BEHIND_NULL
from validation.schema.data_set import DataSetTables
from validation.sensor_file import BUILT_IN
from validation.verdict import ACCEPTED, NOT_ACCEPTED, Verdict, judge

#: Limits by the name of the metric.
Limits = Mapping[str, float]

#: Edges of the stamp [m].
_STAMP = (8e-3, 12e-3)
#: Position of the stamp in each series [m].
_PLACES: Mapping[str, tuple[float, float]] = MappingProxyType({"first": (0.4e-3, -0.7e-3), "second": (1.6e-3, 1.9e-3)})
#: Loads of each series [N].  The last one is the first of them once more.
_LOADS = (4.0, 1.5, 2.5, 5.5, 7.0, 8.5, 4.0)
#: Sensitivity [counts/N], dead force [N], temperature coefficient [1/K] and creep per unit of ln(time) [-].
_SLOPE, _DEAD, _WARM, _CREEP = 2000.0, 0.02, 0.008, 0.03
#: Counts that the firmware subtracts, and standard deviation of the width at which the cover spreads forces [-], [m].
_THRESHOLD, _WIDTH = 60.0, 1.2e-3
#: Time of loading, duration and interval of frames of a recording [s].
_LOADED, _SECONDS, _INTERVAL = 2.0, 11.0, 0.25
#: Pitch of the texels [m].
_PITCH = (4e-3, 4e-3)
#: Tolerance of the guarded metrics on recordings in their units, by field of `CountScore`.
_METRICS = MappingProxyType({"image_changed_percent": 0.01, "total_counts_error": 0.05, "centre_of_pressure_m": 0.002})
#: Limits on the distance behind the best null model: below the mean, within its interval, and above [% of white].
_BEHIND = (-0.2, 0.03, 0.3)
#: Made-up shares of the load on wrong texels in five cases [-].
_ERRORS = (0.02, 0.05, 0.01, 0.08, 0.03)
#: Limits on the mean of these shares: below the mean, within its interval, and above [-].
_LIMITS = (0.03, 0.05, 0.09)
#: The data-set file.
_FILE = f"""
name = "made up"
indenter = "box:size=8mmx12mmx5mm"
yaw = "0 deg"
threshold = {_THRESHOLD}
[[series]]
name = "first"
files = "first/*"
window = [3, 5]
[[series]]
name = "second"
files = "second/*"
window = [5, 8]
[[split]]
name = "moved"
fit = "first"
place = {{ series = "second", least = "5.5 N", most = "5.5 N" }}
score = [{{ series = "second", most = "4 N" }}, {{ series = "second", least = "7 N" }}]
"""


def _share_along(centres: FloatArray, pitch: float, at: float, size: float) -> FloatArray:
    """Return the share of a uniform pressure over an interval on each texel along one axis, shape (n,) [-]."""
    points = at + size * ((np.arange(64) + 0.5) / 64 - 0.5)
    low, high = (ndtr((centres[:, None] + side * pitch / 2 - points) / _WIDTH) for side in (-1, 1))
    return np.asarray((high - low).mean(axis=1))


def make_recording(array: TexelArray, load: float, at: tuple[float, float], number: int) -> Recording:
    """Make the recording of a load on the stamp.

    Args:
        array: The n texels.
        load: Load [N].
        at: Position of the stamp [m].
        number: Number of the recording in its series, which chooses temperature and scatter [-].
    """
    texels = np.arange(array.count)
    share = np.prod([_share_along(array.centres[:, k], array.pitch[k], at[k], _STAMP[k]) for k in (0, 1)], axis=0)
    gains, zeros = 1 + 0.2 * np.sin(2.1 * texels), 300.0 + 15 * texels
    times = np.arange(0, _SECONDS, _INTERVAL)
    degrees = 24.0 + 4 * (number % 3)
    growth = (1 + _WARM * (degrees - 28)) * (1 + _CREEP * np.log(np.maximum(times - _LOADED, 0.1) / 2))
    force = np.where(times >= _LOADED, load * (1 + 0.01 * np.sin(5.0 * number)), 0.0)[:, None] * share
    signal = gains * (growth[:, None] * _SLOPE * (force - _DEAD) + _THRESHOLD) - _THRESHOLD
    noise = 3 * np.sin(12.9898 * (np.arange(len(times))[:, None] + 7 * number) + 78.233 * texels)
    counts = np.rint(zeros + np.where(signal > 0, signal + noise, 0.0)).astype(np.int32)
    return Recording(
        path=Path("made-up"),
        sha256="",
        started=datetime(2026, 1, 1, tzinfo=UTC),
        times=times,
        arrays=(make_array(array.rows, array.columns, counts, pitch=array.pitch, active=array.active),),
        temperatures=np.full((2, 1), degrees),
        temperature_times=times[[0, -1]],
        setup=Setup(load=load),
    )


@contextmanager
def _write_data_set(array: TexelArray) -> Iterator[DataSet]:
    """Write recordings and data-set file to a folder that is removed afterwards, and read them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for series, at in _PLACES.items():
            (folder / series).mkdir()
            for number, load in enumerate(_LOADS):
                tables.write(make_recording(array, load, at, number), folder / series / f"{number}.csv")
        (folder / "set.toml").write_text(_FILE, encoding="utf-8")
        yield build_data_set(read_tables(folder / "set.toml", DataSetTables), source=folder / "set.toml", folder=folder)


def calibrate_fixed_recordings(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Calibrate the made-up sensor: estimates and gains with intervals, poses, electronics, hold-out score."""
    parameters = make_oblong(_PITCH)
    image = parameters.array.image
    with _write_data_set(parameters.array) as data_set:
        images, faults = read_images(data_set, parameters.array)
    found = calibrate(observe(images), make_fast_method(parameters), noise=[each.noise for each in images])
    return {
        "images": read({each.file.name: each.total for each in images}, "counts", "0.1 % of each"),
        "faults of recordings": read(float(len(faults)), "-", 0.5),
        "estimates": read(
            {f"{name} [{each.unit}]": [each.value, each.low, each.high] for name, each in found.estimates.items()},
            "value and interval",
            "0.5 % of each",
        ),
        "gains": read(list_rows(image(found.gains)), "-", "0.5 % of largest"),
        "half widths of gains": read(list_rows(image(np.nan_to_num(found.gain_half_widths))), "-", "2 % of largest"),
        "poses": read(list_numbers(found.poses), "value and half width, SI", "1 % of each"),
        "left-out recordings": read(
            None if found.hold_out is None else found.hold_out.image_changed_percent, "% of white", "1 % of each"
        ),
        "electronics": read(list_numbers(found.electronics()), "of a sensor file", "0.5 % of each"),
    }


def score_fixed_recordings(subject: Subject) -> Readings:
    """Score the fast model, finite elements and null models on the made-up recordings, and judge them."""
    if subject.derivation is None:  # Without finite elements there is no reference.
        return {}
    parameters = make_oblong(_PITCH)
    sensor = replace(BUILT_IN["wts-0614-34"], array=parameters.array)
    with _write_data_set(parameters.array) as data_set:
        scores = score_recordings(data_set, sensor, parameters, inputs=Inputs(friction=0.0))
    # The forces of boxes jump with the pose, so that poses fitted with them depend on rounding.
    rows = {row.model + ", texel gains" * row.texel_gains: row for row in scores.rows if "boxes" not in row.model}
    fitted, _, behind = find_difference(scores.rows)
    errors = {
        f"{each.case}, {each.quantity}": [each.u_num, each.u_input, each.u_data]
        for found in scores.errors.values()
        for each in found
    }
    verdicts = {
        f"at most {limit:g} % behind": judge(
            _make_campaign({}), None, scores, required={BEHIND_NULL: limit}, splits=list(scores.errors)
        )
        for limit in _BEHIND
    }

    def collect(metric: str) -> Reading | None:
        means = {name: row.pooled[metric].mean for name, row in rows.items()}
        return read(list_numbers(means), find_unit(metric), _METRICS[metric])

    return {
        **{metric: collect(metric) for metric in _METRICS},
        "behind the best null": read(list_numbers(behind), "% of white, with interval", 0.01),
        "parameters": read(list_numbers(fitted.parameters), "SI", "1 % of each"),
        "electronics": read(list_numbers(fitted.electronics), "SI", "1 % of each"),
        "uncertainties": read(errors, "u_num, u_input, u_D in SI", "2 % of each"),
        "verdict": _read_states(verdicts),
        "faults": read(float(len(scores.problems)), "-", 0.5),
    }


def judge_fixed_scores(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Judge made-up scores of a campaign by limits below the mean, within its interval and above, in several states."""
    whole, few = _make_result(_ERRORS), _make_result(_ERRORS[:4])
    low, middle, high = ({"misplaced_force": limit} for limit in _LIMITS)
    states = {
        "mean above the limit": (_make_campaign(low), whole),
        "interval beyond the limit": (_make_campaign(middle), whole),
        "interval below the limit": (_make_campaign(high), whole),
        "one case above its limit": (_make_campaign(high, each=middle), whole),
        "every case below its limit": (_make_campaign(high, each=high), whole),
        "four cases": (_make_campaign({"misplaced_force": 2 * _LIMITS[2]}), few),
        "a fault in the campaign": (_make_campaign(high, left_out=("a fault",)), whole),
        "interrupted": (_make_campaign(high), replace(whole, interrupted=True)),
        "inaccurate reference": (_make_campaign(high), replace(whole, noise_floor={"misplaced_force": 0.04})),
        "no limit": (_make_campaign({}), whole),
    }
    verdicts = {name: judge(*state) for name, state in states.items()}
    findings = {
        f"{name}, {each.over}": [each.value, each.low, each.high]
        for name, verdict in verdicts.items()
        for each in verdict.findings
        if each.cases > 1
    }
    return {
        "verdict": _read_states(verdicts),
        "mean misplaced force": read(findings, "value and interval", "0.1 % of each"),
    }


def _read_states(verdicts: Mapping[str, Verdict]) -> Reading | None:
    """Return each verdict and the states of its requirements as numbers: 1, -1, or 0 for not decided."""
    states = {ACCEPTED: 1.0, NOT_ACCEPTED: -1.0, "met": 1.0, "missed": -1.0}
    found = {name: [each.word, *(finding.status for finding in each.findings)] for name, each in verdicts.items()}
    rows = {name: [states.get(each, 0.0) for each in row] for name, row in found.items()}
    return read(rows, "1 accepted or met, -1 not accepted or missed", 0.5)


def _make_campaign(mean: Limits, *, each: Limits | None = None, left_out: tuple[str, ...] = ()) -> Campaign:
    """Make a campaign without cases, with limits on means and on every case."""
    criterion = Criterion(mean=mean, each=each or {}, recordings={})
    return Campaign(
        name="made up", source="made up", intended_use="", criterion=criterion, inputs=Inputs(), cases=(),
        left_out=left_out,
    )  # fmt: skip


def make_case_result(case: Case, true: FloatArray, found: FloatArray, parameters: Parameters) -> CaseResult:
    """Make the result of a case from given texel forces.

    Args:
        case: The indentation.
        true: Texel forces of the reference, shape (n,) [N].
        found: Texel forces of the fast model, shape (n,) [N].
        parameters: Parameters of the fast model.
    """
    outside, missed = (case.load - float(each.sum()) for each in (true, found))
    reference = Reference(
        texel_forces=true, outside=outside, total_force=case.load, depth=1e-4, contact_area=1e-4, error_estimate={},
        assumptions={}, warnings=(),
    )  # fmt: skip
    made = predict(reference, {"fast": (found, missed)}, case.load, parameters)
    return CaseResult(case=case, reference=reference, predictions=made, warnings=())


def _make_result(errors: Sequence[float]) -> CampaignResult:
    """Make the result of a campaign in which the fast model misplaces given shares of the load [-]."""
    parameters, load = make_oblong(), 3.0
    even = np.full(parameters.array.count, load / parameters.array.count)
    moved = np.zeros_like(even)
    moved[[7, 12]] = load, -load
    return CampaignResult(
        cases=tuple(
            make_case_result(
                Case.read(f"case {number}", "sphere:radius=5mm", f"{load} N"), even, even + error * moved, parameters
            )
            for number, error in enumerate(errors)
        ),
        skipped=(),
        pooled={},
        skill={},
        noise_floor={"misplaced_force": 1e-3},
    )
