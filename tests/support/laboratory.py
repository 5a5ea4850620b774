"""A made-up laboratory: recordings of a known sensor under known loads, with known gains, temperatures and poses."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from meshes import Box, TexelArray
from meshes.array_types import FloatArray
from validation.calibration.model import ContactMethod, CountCurve, Observations, Placement, Pose, seat_unevenly
from validation.data_sets.data_set import build_data_set
from validation.recordings.importing import save
from validation.recordings.recording import Recording, Setup, make_array
from validation.schema import read
from validation.schema.data_set import DataSetTables

ROWS, COLUMNS, PITCH = 8, 10, 5e-3
#: Middles of the nine places where the stamp is put down [m].
PLACES = [(x, y) for y in (-12e-3, 12e-3, 0.0) for x in (-15e-3, 0.0, 15e-3)]
ARRAY = TexelArray.grid(ROWS, COLUMNS, PITCH, name="made up")
STAMP = Box(size=(16e-3, 12e-3, 5e-3))
STAMP_TEXT = "box:size=16mmx12mmx5mm"


def make_curve(gains: FloatArray, *, sensitivity=917.0, warm=0.0, dead_warm=0.0, creep=0.0) -> CountCurve:
    return CountCurve(
        sensitivity=sensitivity,
        dead_force=0.02,
        gain_temperature=warm,
        dead_temperature=dead_warm,
        reference_temperature=30.0,
        creep=creep,
        output_max=4095.0,
        saturation_band=300.0,
        gains=gains,
        heights=np.zeros(len(gains)),
    )


def draw_gains(random, *, sd=0.15, count=ROWS * COLUMNS) -> FloatArray:
    gains = np.exp(random.normal(0, sd, count))
    return gains / gains.mean()


def uniform_method(array=ARRAY, *, sigma=0.5) -> ContactMethod:
    """Uniform pressure under the level face of a box, spread by a Gaussian of `sigma` pitches; exact integrals."""
    from scipy.special import erf

    def shares(centres, at, half, sigma, pitch):
        # The integral of erf, for the share of a Gaussian-blurred interval on each texel.
        def primitive(x):
            z = x / (sigma * np.sqrt(2))
            return x * erf(z) + sigma * np.sqrt(2 / np.pi) * np.exp(-(z**2))

        edges = centres[:, None] + np.array([-pitch / 2, pitch / 2]) - at
        cumulated = (primitive(edges + half) - primitive(edges - half)) / (4 * half)
        return cumulated[:, 1] - cumulated[:, 0]

    def solve(indenter, load, pose):
        width = sigma * array.pitch[0]
        x, y = array.centres[:, 0], array.centres[:, 1]
        along = [
            shares(c, at, size / 2, width, p)
            for c, at, size, p in (
                (x, pose.x, indenter.size[0], array.pitch[0]),
                (y, pose.y, indenter.size[1], array.pitch[1]),
            )
        ]
        return load * along[0] * along[1]

    return ContactMethod(name="uniform", about="uniform pressure", array=array, solve=solve)


def press(
    method: ContactMethod,
    curve: CountCurve,
    load: float,
    pose: Pose,
    *,
    indenter=STAMP,
    temperature=30.0,
    random=None,
    noise=3.0,
    scatter=0.0,
    seconds=12.0,
    rate=8.0,
    threshold=0.0,
) -> Recording:
    """A recording of a weight that is put on after one second; `scatter` is the relative error of its load."""
    random = np.random.default_rng(0) if random is None else random
    times = np.arange(0, seconds, 1 / rate)
    actual = load * (1 + scatter * random.standard_normal())
    forces = method.texel_forces(indenter, np.array([actual]), pose)
    ages = np.maximum(times - 1.0, 0.1)
    rows = len(times)
    counts = curve.predict(
        np.where(times[:, None] > 1.0, forces, 0.0),
        temperatures=np.full(rows, temperature),
        ages=ages,
        thresholds=np.full(rows, threshold),
    )
    lit = np.maximum(np.rint(counts + noise * random.standard_normal(counts.shape) * (counts > 0)), 0)
    array = method.array
    return Recording(
        path=Path("made-up"),
        sha256="",
        started=datetime(2026, 1, 1, tzinfo=UTC),
        times=times,
        arrays=(make_array(array.rows, array.columns, lit.astype(np.int32), pitch=array.pitch, name=array.name),),
        temperatures=np.full((2, 1), temperature),
        temperature_times=np.array([0.0, times[-1]]),
        setup=Setup(load=load, indenter=STAMP_TEXT, device={"threshold": threshold}),
    )


def observe_presses(
    random,
    curve: CountCurve,
    *,
    places=6,
    loads=(5.0, 10.0, 15.0, 20.0),
    temperatures=(30.0,),
    scatter=0.005,
    noise=2.0,
    known=False,
    method=None,
    indenter=STAMP,
    heights=0.0,
) -> tuple[Observations, dict[str, Pose]]:
    """Mean images of weights in several places, each with a load error of its own, and the true pose of each place.

    `heights` is the standard deviation of the seating heights of a place [N]; each recording changes them by 30 %.
    """
    method = uniform_method() if method is None else method
    columns = {name: [] for name in ("loads", "counts", "placements", "groups", "temperatures")}
    poses = {}
    for number, (x, y) in enumerate(PLACES[:places]):
        pose = Pose(x + random.normal(0, 1e-3), y + random.normal(0, 1e-3))
        at = (pose.x, pose.y) if known else None
        placement = Placement(name=f"place {number}", indenter=indenter, at=at, yaw=0.0)
        poses[placement.name] = pose
        seat = random.normal(0, heights, method.array.count) if heights else 0.0
        for degrees in temperatures:
            for load in loads:
                actual = load * (1 + scatter * random.standard_normal())
                forces = method.texel_forces(indenter, np.array([actual]), pose)
                if heights:
                    forces = seat_unevenly(forces, seat + 0.3 * random.normal(0, heights, method.array.count))
                counts = curve.predict(
                    forces,
                    temperatures=np.array([degrees]),
                    ages=np.array([2.0]),
                    thresholds=np.zeros(1),
                )[0]
                noisy = counts + noise * random.standard_normal(len(counts)) * (counts > 0)
                columns["loads"].append(load)
                columns["counts"].append(np.maximum(noisy, 0.0))
                columns["placements"].append(placement)
                columns["groups"].append(f"{number}, {load:g} N, {degrees:g} degC")
                columns["temperatures"].append(degrees)
    count = len(columns["loads"])
    arrays = {name: np.array(columns[name]) for name in ("loads", "counts", "temperatures")}
    nothing = np.full(count, np.nan)
    return Observations(
        **arrays,
        measured=np.ones(arrays["counts"].shape, dtype=bool),
        placements=tuple(columns["placements"]),
        groups=tuple(columns["groups"]),
        ages=nothing,
        thresholds=np.zeros(count),
        creep=nothing,
    ), poses


def write(recording: Recording, path: Path) -> Path:
    """Write a recording as labelled CSV, by hand as a laboratory would, or as MCAP."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix != ".csv":
        save(recording, path)
        return path
    recorded, setup = recording.arrays[0], recording.setup
    notes = {
        "rows": recorded.texels.rows,
        "columns": recorded.texels.columns,
        "pitch": recorded.texels.pitch[0],
        "full_scale": recorded.full_scale,
        "indenter": setup.indenter,
        "load": setup.load,
    }
    degrees = np.interp(recording.times, recording.temperature_times, recording.temperatures[:, -1])
    lines = [f"# {key} = {value}" for key, value in notes.items() if value is not None]
    lines.append(",".join(["time", "temperature", *(f"texel_{n}" for n in range(recorded.counts.shape[1]))]))
    for time, warm, counts in zip(recording.times, degrees, recorded.counts, strict=True):
        lines.append(",".join([f"{time:.6f}", f"{warm:.3f}", *(str(count) for count in counts)]))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_data_set(folder: Path, text: str, recordings=None):
    """Write a data-set file, and find its recordings."""
    path = folder / "set.toml"
    path.write_text(text)
    return build_data_set(read(path, DataSetTables), source=path, folder=recordings or folder)
