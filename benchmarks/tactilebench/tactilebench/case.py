"""Form of a case: bodies that press on the cover of a tactile array, and the true forces on its texels.

All numbers are in SI units.  In the array's frame x goes along columns, y along rows and z out of the cover.  The
texels of a flat array lie in the plane z = 0, the base of the cover, and the cover's top at z = thickness.  Texels are
in row-major order, x fastest.  The body is rigid, keeps its attitude, and moves along its direction until the load is
reached.  The force on a texel is that along its normal, positive under pressure.
"""

from __future__ import annotations

import hashlib
import json
import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: Folder of the data in the package.
DATA = Path(__file__).parent / "data"


class BenchError(ValueError):
    """Input that cannot be scored; the message is one line that states the place and the remedy."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body that presses on the cover, with its pose and its load.

    In the body's frame the origin is the lowest point on its axis, and z points away from the cover.  Shapes and their
    numbers: `sphere` (radius); `tip` (radius), a rod with a hemispherical end; `cylinder` (radius), upright with a flat
    end; `box` (size: edge lengths along x, y, z); `roller` (radius, length), a cylinder that lies along y; `nut`
    (across, bore), a hexagonal nut that lies flat, two side faces perpendicular to x, whose bore is a hexagon of the
    area of the round one; `h` (size along x and y, bar), the letter H with legs along y; `triangles` (vertices, faces),
    a closed surface whose triangles are counterclockwise as seen from outside.

    Attributes:
        shape: Name of the shape and its numbers, for example `{"shape": "sphere", "radius": 0.005}` [m].
        at: Position of the body's origin when it first touches; on a flat cover z is that of the top, and a tilted body
            first touches at another point [m].
        direction: Unit direction of the motion [-].
        yaw: Rotation about the axis of the motion, counterclockwise as seen against it [rad].
        tilt: Rotation vector along the body's own x and y axes, applied before the yaw [rad].
        load: Force along the direction [N].
    """

    shape: Mapping[str, Any]
    at: tuple[float, float, float]
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    yaw: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    load: float

    @property
    def rotation(self) -> FloatArray:
        """Rotation matrix whose columns are the body's axes in the array's frame, shape (3, 3) [-].

        At yaw 0 the body's y axis is as close as possible to the array's, and z points against the direction.
        """
        z = -np.array(self.direction)
        y = np.array([0.0, 1.0, 0.0]) - z[1] * z
        y /= np.linalg.norm(y)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        angle = math.hypot(*self.tilt)
        u, v = (each / angle for each in self.tilt) if angle else (0.0, 0.0)
        cross = np.array([[0, 0, v], [0, 0, -u], [-v, u, 0]])  # Rodrigues' formula
        lean = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        return np.asarray(np.stack([np.cross(y, z), y, z], axis=1) @ turn @ lean)


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One elastic layer of the cover.

    Attributes:
        thickness: Thickness [m].
        youngs_modulus: Young's modulus at small strain [Pa].
        poisson_ratio: Poisson ratio at small strain [-].
        law: `linear-elastic`, or `neo-hookean` at finite strain: W = mu / 2 (I1 J^(-2/3) - 3) + K / 2 (J - 1)^2 with
            the shear modulus mu = E / (2 (1 + nu)) and the bulk modulus K = E / (3 (1 - 2 nu)).
    """

    thickness: float
    youngs_modulus: float
    poisson_ratio: float
    law: str = "linear-elastic"


@dataclass(frozen=True, kw_only=True)
class Cover:
    """The elastic cover between body and array, bonded to a rigid base.

    Attributes:
        layers: Layers from base to top, bonded to one another.
        friction: Coefficient of Coulomb friction between body and cover; inf for no slip [-].
        size: Edge lengths along x and y of a flat cover with free sides [m]; None for a laterally wide cover.
        geometry: Name of a solid cover (`fingertip`, `phalanx`, `flat-pad`), see `Case.surface`; empty for flat layers.
    """

    layers: tuple[Layer, ...]
    friction: float = 0.0
    size: tuple[float, float] | None = None
    geometry: str = ""

    @property
    def thickness(self) -> float:
        """Total thickness of the layers [m]."""
        return sum(each.thickness for each in self.layers)


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Quasi-static motion of the first body: at each of t instants, its position and load; inertia has no effect.

    Attributes:
        times: Instants, shape (t,) [s].
        at: Position of the body at each instant, as `Body.at`, shape (t, 3) [m].
        loads: Load at each instant, shape (t,) [N].
    """

    times: tuple[float, ...]
    at: tuple[tuple[float, float, float], ...]
    loads: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Truth:
    """True forces with 95 % intervals: value minus to value plus half width.

    Attributes:
        forces: Force on each texel, shape (n,), or (t, n) with a motion of t instants [N].
        half_width: Half widths of the intervals, same shape [N].
        outside: Force on the base beyond the texels, shape () or (t,); zero on solid covers [N].
        outside_half_width: Half widths of its intervals, same shape [N].
        command: Command that computes these numbers anew.
        digest: SHA-256 of the definition of the case and these numbers.
    """

    forces: FloatArray
    half_width: FloatArray
    outside: FloatArray
    outside_half_width: FloatArray
    command: str
    digest: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One case: what presses on which cover, where the n texels are, and the truth if it is known.

    Attributes:
        name: Name, unique in its version and seed.
        tier: Kind of case.
        version: Version of the benchmark.
        bodies: Bodies that press at the same time, usually one.
        motion: Motion of the body; None for a static press.
        cover: The cover.
        rows: Number of rows of a flat array along y; 1 on a fingertip, whose texels are in no rows [-].
        columns: Number of columns along x [-].
        pitch: Distance of neighbouring texels along their two axes [m].
        texel_size: Edge lengths of a texel along its two axes [m].
        centres: Centres of the texels, shape (n, 3) [m].
        normals: Unit normals of the texels, shape (n, 3) [-].
        truth: True forces; None where they are not computed yet.
    """

    name: str
    tier: str
    version: str
    bodies: tuple[Body, ...]
    motion: Motion | None = None
    cover: Cover
    rows: int
    columns: int
    pitch: tuple[float, float]
    texel_size: tuple[float, float]
    centres: FloatArray = field(repr=False)
    normals: FloatArray = field(repr=False)
    truth: Truth | None = field(default=None, repr=False)

    @property
    def loads(self) -> tuple[float, ...]:
        """Load of all bodies together at each instant; a static press has one instant [N]."""
        return self.motion.loads if self.motion else (sum(each.load for each in self.bodies),)

    @property
    def load(self) -> float:
        """Largest load [N]."""
        return max(self.loads)

    @property
    def areas(self) -> FloatArray:
        """Areas of the texels, shape (n,) [m2]."""
        return np.full(len(self.centres), math.prod(self.texel_size))

    @property
    def surface(self) -> tuple[FloatArray, npt.NDArray[np.int64]] | None:
        """Top of a solid cover: vertices, shape (v, 3) [m], and triangles, shape (f, 3); None for flat layers."""
        if not self.cover.geometry:
            return None
        arrays = read_geometry(self.cover.geometry)
        return arrays["vertices"], arrays["faces"].astype(np.int64)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the forces: (n,), or (t, n) with a motion."""
        return (len(self.loads),) * bool(self.motion) + (len(self.centres),)

    def as_json(self) -> dict[str, Any]:
        """Return the definition of the case, without truth and without what follows from it, for JSON."""
        omitted = {"centres", "normals", "truth"}
        return {key: value for key, value in asdict(replace(self, truth=None)).items() if key not in omitted}

    def with_truth(
        self,
        forces: npt.ArrayLike,
        half_width: npt.ArrayLike,
        outside: npt.ArrayLike,
        outside_half_width: npt.ArrayLike,
        *,
        command: str,
    ) -> Case:
        """Return the case with its truth; shapes as in `Truth`.

        Raises:
            BenchError: If a shape is wrong, a number is not finite, or a half width is negative.
        """
        arrays = [np.array(each, dtype="<f8") for each in (forces, half_width, outside, outside_half_width)]
        if [each.shape for each in arrays] != [self.shape, self.shape, self.shape[:-1], self.shape[:-1]]:
            raise BenchError(f"truth of {self.name}: forces and half widths must have the shape {self.shape}")
        if not all(np.isfinite(each).all() for each in arrays) or min(arrays[1].min(), arrays[3].min()) < 0:
            raise BenchError(f"truth of {self.name}: numbers must be finite, half widths not negative")
        digest = hashlib.sha256((json.dumps(self.as_json(), sort_keys=True) + command).encode())
        for values in arrays:
            digest.update(values.tobytes())
        return replace(self, truth=Truth(arrays[0], arrays[1], arrays[2], arrays[3], command, digest.hexdigest()))

    def require_truth(self) -> Truth:
        """Return the truth.

        Raises:
            BenchError: If there is none.
        """
        if self.truth is None:
            raise BenchError(f"{self.name} has no truth; let softcover compute it, or take the shipped cases")
        return self.truth


def save_truth(path: str | Path, cases: Sequence[Case], *, seed: int | None, made_by: str) -> None:
    """Write the truth of cases of one version and seed to an npz file.

    The cases themselves are not in the file: they are drawn anew, and the digests show that they are the same.

    Args:
        path: The file.
        cases: Cases with truth.
        seed: Seed with which the cases were drawn; None for the cases of the release.
        made_by: Name and version of the program that computed the truth.
    """
    truths = {case.name: case.require_truth() for case in cases}
    entries = [{"name": name, "command": each.command, "digest": each.digest} for name, each in truths.items()]
    about = {
        "version": cases[0].version,
        "seed": None if seed is None else int(seed),
        "made_by": made_by,
        "cases": entries,
    }
    np.savez_compressed(
        path,
        about=np.array(json.dumps(about)),
        values=np.concatenate([np.append(each.forces, each.outside) for each in truths.values()]),
        half_widths=np.concatenate([np.append(each.half_width, each.outside_half_width) for each in truths.values()]),
    )


def load_truth(path: str | Path) -> tuple[Case, ...]:
    """Read a file of `save_truth`, draw its cases, and return them with their truth.

    Raises:
        BenchError: If the file cannot be read, or the cases drawn here are not those of the file.
    """
    from tactilebench.draw import draw

    arrays = read_arrays(path)
    try:
        about, values = json.loads(str(arrays["about"])), np.stack([arrays["values"], arrays["half_widths"]])
        drawn = {case.name: case for case in draw(about["version"], about["seed"])}
        known = tuple(_attach_truths(drawn, about["cases"], values))
    except (ValueError, LookupError, TypeError) as error:
        raise BenchError(f"{path}: is no file of truth that fits: {error}; compute it with truth.py") from None
    if not known:
        raise BenchError(f"{path}: holds the truth of no case; compute it with truth.py")
    return known


def read_arrays(path: str | Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an npz file by name.

    Raises:
        BenchError: If the file is damaged, or no npz file.
    """
    check_file(path)
    try:
        with Path(path).open("rb") as file, zipfile.ZipFile(file):  # numpy takes other files for pickles
            pass
        with np.load(path) as found:
            return {name: found[name] for name in found}
    except Exception as error:  # noqa: BLE001 -- damaged archives raise most kinds of errors, by what is damaged
        why = error.strerror if isinstance(error, OSError) else " ".join(str(error).split())
        raise BenchError(f"{path}: cannot be read: {why or type(error).__name__}; write it anew") from None


def check_file(path: str | Path) -> None:
    """Check that a path names a file if it names anything.

    Raises:
        BenchError: If it is a folder, or a device or pipe, which may never end.
    """
    if Path(path).exists() and not Path(path).is_file():
        raise BenchError(f"{path}: is a folder, a device or a pipe; name a file")


def as_numbers(place: str, values: npt.ArrayLike) -> FloatArray:
    """Return values as numbers.

    Raises:
        BenchError: If some are no real numbers, or masked.
    """
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise BenchError(f"{place}: is no array: {error}") from None
    if array.dtype.kind not in "biuf" or (isinstance(values, np.ma.MaskedArray) and values.mask.any()):
        raise BenchError(f"{place}: must hold real numbers, none masked, not {array.dtype}")
    return array.astype(np.float64)


def _attach_truths(
    drawn: Mapping[str, Case], entries: Sequence[Mapping[str, str]], values: FloatArray
) -> Iterator[Case]:
    """Yield the cases with their truth from the values and half widths of all of them, shape (2, ...) [N]."""
    start = 0
    for entry in entries:
        case = drawn[entry["name"]]
        middle = start + math.prod(case.shape)
        stop = middle + len(case.loads)
        forces, outside = values[:, start:middle].reshape(2, *case.shape), values[:, middle:stop]
        known = case.with_truth(*forces, *outside.reshape(2, *case.shape[:-1]), command=entry["command"])
        if known.require_truth().digest != entry["digest"]:
            raise BenchError(f"{case.name} is not the case that was computed; install the version that drew it")
        yield known
        start = stop


def cases(version: str = "2026.1", *, seed: int | None = None) -> tuple[Case, ...]:
    """Return the cases of a release with their truth; with a seed, fresh cases of every tier without truth.

    Raises:
        BenchError: If the version is unknown, or the package holds no truth of it.
    """
    from tactilebench.draw import draw

    drawn = draw(version, seed)
    if seed is not None:
        return drawn
    path = DATA / f"{version}.npz"
    if not path.is_file():
        raise BenchError(f"{path} is missing: this package holds no truth of {version}; install the released wheel")
    return load_truth(path)


@cache
def read_geometry(name: str) -> dict[str, FloatArray]:
    """Return the arrays of a solid cover: its texels, and the vertices and faces of its top."""
    with np.load(DATA / "geometry.npz") as file:
        return {key.partition("/")[2]: file[key] for key in file if key.startswith(f"{name}/")}
