"""The parameters of one sensor, and the folder that holds them: `parameters.toml` beside `cover.npz`.

The TOML file is complete and in SI units: array, spread, filter, electronics, provenance.  `cover.npz` holds the
large tables: the spread operator `[texel, loaded texel]`, the cover between sub-texel cells, and any further tables.
The TOML file contains the sha256 of `cover.npz`.  Nothing is pickled.  If a save is killed, the folder holds either the
old pair of files or the new one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import os
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fastmodel.errors import ParametersError, ShapeError, check_type
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import Electronics
from fastmodel.signal.point_spread import Gaussian, Spread, Tabulated
from meshes import TexelArray, atomic_file
from meshes.array_types import FloatArray
from meshes.npz import pack_npz

#: Version of the folder's format; other versions are refused.
FORMAT = 1
TOML_NAME = "parameters.toml"
NPZ_NAME = "cover.npz"
#: Folder of the sensors that come with the package, one folder each.
SENSORS = Path(__file__).parent / "sensors"
#: Name of the spread operator among the tables.
_OPERATOR = "operator"
#: Attributes of `CoverCells` that are tables, with their names among the tables.
_CELL_TABLES = {name: f"cells_{name}" for name in ("compliance", "influence", "table")}
#: Names that further tables must not have.
_RESERVED = (_OPERATOR, *_CELL_TABLES.values())


@dataclass(frozen=True, kw_only=True, eq=False)
class Parameters:
    """The parameters of a tactile array with its cover.

    Attributes:
        array: The texels.
        spread: The point spread of the cover.
        electronics: The conversion of forces to counts.
        filter: Low-pass filter on every texel; None for none.
        provenance: Origin of the numbers: estimator, versions, hashes, assumptions.
        tables: Further arrays of the cover that are stored with it, by name, for example a point response.
        cells: The cover between sub-texel cells, for the contact methods `cover` and `foundation`; None if unknown.
    """

    array: TexelArray
    spread: Spread
    electronics: Electronics
    filter: Butterworth | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, FloatArray] = field(default_factory=dict)
    cells: CoverCells | None = None

    def __post_init__(self) -> None:
        """Check that the parts fit one another.

        Raises:
            ArgumentTypeError: If a part has a wrong type.
            ShapeError: If spread operator, gains or cells are for another array.
            ParametersError: If a table has a name that the format uses itself.
        """
        check_type("array", self.array, TexelArray, "a meshes.TexelArray")
        check_type("electronics", self.electronics, Electronics, "a fastmodel.Electronics")
        check_type("filter", self.filter, (Butterworth, type(None)), "a fastmodel.Butterworth or None")
        if isinstance(self.spread, Tabulated):
            self.spread.operator(self.array)
        gains = self.electronics.gains
        if gains is not None and len(gains) != self.array.count:
            raise ShapeError(f"there are gains for {len(gains)} texels; the array has {self.array.count}")
        if self.cells is not None:
            self.cells.check(self.array)
        for name in _RESERVED:
            if name in self.tables:
                raise ParametersError(f"a table must not be named {name!r}; the format uses that name itself")

    def save(self, folder: str | Path) -> Path:
        """Write `parameters.toml` and `cover.npz` into a folder, which is made if it does not exist.

        Args:
            folder: The folder.

        Returns:
            The path of `parameters.toml`.

        Raises:
            OSError: If the folder cannot be written.
        """
        # Only writing needs this package.
        import tomli_w

        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        tables = {_OPERATOR: self.spread.operator(self.array), **self.tables}
        for name, stored in _CELL_TABLES.items():
            if (table := getattr(self.cells, name, None)) is not None:
                tables[stored] = table
        packed = pack_npz(tables)
        text = tomli_w.dumps(_describe(self, hashlib.sha256(packed).hexdigest()))
        _replace_pair(target, packed, text.encode())
        return target / TOML_NAME


def list_sensors() -> tuple[str, ...]:
    """Names of the sensors whose parameters come with the package."""
    return tuple(sorted(path.parent.name for path in SENSORS.glob(f"*/{TOML_NAME}")))


def load(sensor: str | Path) -> Parameters:
    """Read the parameters of a sensor.

    Args:
        sensor: Name of a sensor that comes with the package (see `list_sensors`), or a folder that `Parameters.save`
            wrote, or its `parameters.toml`.  A text that is such a name means the sensor; write `./name` for a folder.

    Raises:
        ArgumentTypeError: If the argument is neither a text nor a path.
        ParametersError: If the name is unknown, or a file is missing, damaged, of another format, or holds bad values.
    """
    check_type("sensor", sensor, (str, os.PathLike), "the name of a sensor or the path of a parameters folder")
    path = SENSORS / sensor if isinstance(sensor, str) and sensor in list_sensors() else Path(sensor)
    if not path.exists():
        raise ParametersError(
            f"{sensor}: no such folder; a folder with {TOML_NAME} and {NPZ_NAME} is needed, or one of the sensors "
            f"{', '.join(list_sensors())}"
        )
    document = _Document(path if path.suffix == ".toml" else path / TOML_NAME)
    if document.take("format") != FORMAT:
        raise ParametersError(f"{document.path}: format is {document.take('format')!r}; this version reads {FORMAT}")
    with document.section("array"):
        array = _build_array(document)
    with document.section("cover"):
        tables = _read_tables(document)
    operator = tables.pop(_OPERATOR, np.zeros(0))
    if operator.shape != (array.count, array.count):
        raise ParametersError(
            f"{document.path.parent / NPZ_NAME}: {_OPERATOR!r} has shape {operator.shape}; {array.count} texels need "
            f"{(array.count, array.count)}"
        )
    with document.section("spread"):
        spread = _build_spread(document.take("spread"), operator)
    with document.section("electronics"):
        electronics = _build_electronics(document.take("electronics"))
    with document.section("filter"):
        low_pass = Butterworth(**document.take("filter")) if "filter" in document.values else None
    with document.section("cells"):
        cells = _build_cells(document.take("cells"), tables) if "cells" in document.values else None
    with document.section("parameters"):
        return Parameters(
            array=array,
            spread=spread,
            electronics=electronics,
            filter=low_pass,
            provenance=dict(document.values.get("provenance", {})),
            cells=cells,
            tables={name: table for name, table in tables.items() if name not in _RESERVED},
        )


class _Document:
    """A parsed TOML file.  Errors name the file and the place in it, in one line.

    Attributes:
        path: Path of the file.
        values: Its content.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.values = tomllib.loads(_read_bytes(path).decode())
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ParametersError(f"{path}: not readable as TOML: {error}") from error

    def take(self, key: str) -> Any:  # noqa: ANN401 -- TOML values
        """The value under a dotted key."""
        value: Any = self.values
        for part in key.split("."):
            if not isinstance(value, Mapping) or part not in value:
                raise ParametersError(f"{self.path}: {key} is missing")
            value = value[part]
        return value

    @contextlib.contextmanager
    def section(self, name: str) -> Iterator[None]:
        """Turn errors about values into errors that name the file and a section."""
        try:
            yield
        except ParametersError:
            raise
        except (TypeError, ValueError, LookupError, ArithmeticError, AttributeError) as error:
            raise ParametersError(f"{self.path}: [{name}] {error}") from error


def _describe(parameters: Parameters, sha256: str) -> dict[str, Any]:
    """The content of the TOML file.

    Args:
        parameters: The parameters.
        sha256: Hash of the npz file.
    """
    document: dict[str, Any] = {
        "format": FORMAT,
        "array": _describe_array(parameters.array),
        "spread": _describe_spread(parameters.spread),
        "electronics": _describe_dataclass(parameters.electronics),
        "cover": {"file": NPZ_NAME, "sha256": sha256},
    }
    if parameters.filter is not None:
        document["filter"] = _describe_dataclass(parameters.filter)
    if parameters.cells is not None:
        values = _describe_dataclass(parameters.cells)
        document["cells"] = {name: value for name, value in values.items() if name not in _CELL_TABLES}
    if parameters.provenance:
        document["provenance"] = _convert_values(parameters.provenance)
    return document


def _describe_array(array: TexelArray) -> dict[str, Any]:
    """Name, size and pitch; mask, positions and normals only if they differ from those of the plain grid."""
    values: dict[str, Any] = {
        "name": array.name,
        "rows": array.rows,
        "columns": array.columns,
        "pitch": list(array.pitch),
        "texel_size": list(array.texel_size),
    }
    if not array.active.all():
        values["active"] = array.image(array.active).astype(int).tolist()
    grid = TexelArray.grid(array.rows, array.columns, array.pitch)
    if not (np.array_equal(array.centres, grid.centres) and np.array_equal(array.normals, grid.normals)):
        values["centres"] = array.centres.tolist()
        values["normals"] = array.normals.tolist()
    return values


def _build_array(document: _Document) -> TexelArray:
    """The inverse of `_describe_array`."""
    pitch, size = document.take("array.pitch"), document.take("array.texel_size")
    table = document.take("array")
    grid = TexelArray.grid(
        document.take("array.rows"),
        document.take("array.columns"),
        (pitch[0], pitch[1]),
        texel_size=(size[0], size[1]),
        active=table.get("active"),
        name=document.take("array.name"),
    )
    if "centres" not in table:
        return grid
    return dataclasses.replace(
        grid,
        centres=np.array(table["centres"], dtype=np.float64),
        normals=np.array(document.take("array.normals"), dtype=np.float64),
    )


def _describe_spread(spread: Spread) -> dict[str, Any]:
    """The numbers of a Gaussian; of any other spread only the source, because its operator is in the npz file."""
    if isinstance(spread, Gaussian):
        return {"kind": "gaussian", **_describe_dataclass(spread)}
    return {"kind": "operator", "source": getattr(spread, "source", type(spread).__name__)}


def _build_spread(table: Mapping[str, Any], operator: FloatArray) -> Spread:
    """The inverse of `_describe_spread`."""
    values = dict(table)
    match values.pop("kind", None):
        case "gaussian":
            return Gaussian(**values)
        case "operator":
            return Tabulated(matrix=operator, **values)
        case kind:
            raise ValueError(f"kind is {kind!r}; it must be 'gaussian' or 'operator'")


def _build_electronics(table: Mapping[str, Any]) -> Electronics:
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    return Electronics(**values)


def _build_cells(table: Mapping[str, Any], tables: Mapping[str, FloatArray]) -> CoverCells:
    stored: dict[str, Any] = {name: tables[key] for name, key in _CELL_TABLES.items() if key in tables}
    return CoverCells(**{**table, "cell": tuple(table["cell"])}, **stored)


def _describe_dataclass(instance: Any) -> dict[str, Any]:  # noqa: ANN401 -- any dataclass instance
    """The fields of a dataclass as TOML values, see `_convert_values`."""
    return _convert_values(dataclasses.asdict(instance))


def _convert_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert tuples and numpy values to TOML values, and leave out None."""
    converted: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            converted[key] = _convert_values(value)
        elif isinstance(value, np.generic | np.ndarray):
            converted[key] = value.tolist()
        elif value is not None:
            converted[key] = list(value) if isinstance(value, tuple) else value
    return converted


def _replace_pair(folder: Path, packed: bytes, text: bytes) -> None:
    """Replace both files such that a reader finds a matching pair at every moment.

    A copy of the old npz file is kept until the TOML file, which names its hash, is replaced too.

    Args:
        folder: The folder.
        packed: Content of the npz file.
        text: Content of the TOML file.

    Raises:
        OSError: If the folder cannot be written; the old pair can still be read then.
    """
    tables = folder / NPZ_NAME
    if tables.exists() and (old := tables.read_bytes()) != packed:
        atomic_file.replace(_path_of_copy(tables, hashlib.sha256(old).hexdigest()), [old])
    atomic_file.replace(tables, [packed])
    atomic_file.replace(folder / TOML_NAME, [text])
    for copy in tables.parent.glob(f"{tables.stem}.????????????????{tables.suffix}"):
        copy.unlink(missing_ok=True)
    atomic_file.sweep(folder)


def _path_of_copy(tables: Path, sha256: str) -> Path:
    """Path of the copy of an npz file of this hash, which exists while the pair is being replaced."""
    return tables.with_name(f"{tables.stem}.{sha256[:16]}{tables.suffix}")


def _read_tables(document: _Document) -> dict[str, FloatArray]:
    """The tables of the npz file that the TOML file names."""
    name, sha256 = document.take("cover.file"), document.take("cover.sha256")
    if name != NPZ_NAME or not isinstance(sha256, str):
        raise ValueError(f"file must be {NPZ_NAME!r} and sha256 a text, not {name!r} and {sha256!r}")
    path = document.path.parent / NPZ_NAME
    packed = _read_bytes(path)
    if hashlib.sha256(packed).hexdigest() != sha256:
        copy = _path_of_copy(path, sha256)
        if not copy.exists():
            raise ParametersError(f"{path}: does not belong to {TOML_NAME} (sha256 differs); write both anew")
        packed = _read_bytes(copy)
    try:
        with np.load(io.BytesIO(packed), allow_pickle=False) as archive:
            return {name: np.asarray(archive[name], dtype=np.float64) for name in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise ParametersError(f"{path}: not a readable npz file: {error}") from error


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ParametersError(
            f"{path}: {error.strerror}; a folder with {TOML_NAME} and {NPZ_NAME} is needed"
        ) from error
