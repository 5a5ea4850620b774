"""Everything the fast model needs, as one folder: `parameters.toml` beside `cover.npz`.

The TOML is complete and in SI: array, spread, filter, electronics, provenance.  `cover.npz` carries what does
not belong into text: the spread operator `[texel, loaded texel]` and any further tables; its sha256 stands in
the TOML.  Nothing is pickled.  A save that is killed at any moment leaves the folder as it was, or as it should
become: never a part of a file, never one file of each.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import tomllib
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from fastmodel.errors import ParametersError, ShapeError
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import Electronics
from fastmodel.signal.point_spread import Gaussian, Spread, Tabulated
from meshes import TexelArray, atomic_file
from meshes.npz import pack_npz

FloatArray = npt.NDArray[np.float64]
T = TypeVar("T")

#: Version of the folder's format; a reader refuses what it does not know.
FORMAT = 1
TOML_NAME = "parameters.toml"
NPZ_NAME = "cover.npz"
#: Folder of the sensors that come with the package, one folder each.
SENSORS = Path(__file__).parent / "sensors"
_OPERATOR = "operator"
_COMPLIANCE = "cells_compliance"
_INFLUENCE = "cells_influence"
_TABLE = "cells_table"
_CELL_TABLES = ("compliance", "influence", "table")
_RESERVED = (_OPERATOR, _COMPLIANCE, _INFLUENCE, _TABLE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Parameters:
    """A tactile array with its cover, as the fast model sees it.

    Attributes:
        array: Where the texels are.
        spread: How the cover spreads force over texels.
        electronics: What the sensor does with a texel's force.
        filter: Low-pass on every texel; None for none.
        provenance: Where the numbers come from: estimator, versions, hashes, assumptions.
        tables: Further arrays of the cover that travel with it, by name, for example a point response.
        cells: The cover between sub-texel cells, for the contact methods `cover` and `foundation`; None where nobody
            knows it.
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
            ShapeError: If the spread operator or the gains are for another number of texels.
            ParametersError: If a table is named like one of the format's own.
        """
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
        """Write `parameters.toml` and `cover.npz` into a folder, made if need be.

        Args:
            folder: Where to.

        Returns:
            The path of `parameters.toml`.

        Raises:
            OSError: If the folder cannot be written.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        tables = {_OPERATOR: self.spread.operator(self.array), **self.tables}
        if self.cells is not None:
            tables |= {_COMPLIANCE: self.cells.compliance, _INFLUENCE: self.cells.influence}
            tables |= {} if self.cells.table is None else {_TABLE: self.cells.table}
        packed = pack_npz(tables)
        # Only writing needs this package.
        import tomli_w

        text = tomli_w.dumps(_describe(self, hashlib.sha256(packed).hexdigest()))
        _replace_pair(target, packed, text.encode())
        return target / TOML_NAME


def list_sensors() -> tuple[str, ...]:
    """Names of the sensors whose parameters come with the package."""
    return tuple(sorted(path.parent.name for path in SENSORS.glob(f"*/{TOML_NAME}")))


def load(sensor: str | Path) -> Parameters:
    """Read the parameters of a sensor.

    Args:
        sensor: Name of a sensor that comes with the package (`list_sensors`), or a folder that `Parameters.save` wrote,
            or its `parameters.toml`.  A text that is such a name means the sensor; write `./name` for a folder.

    Raises:
        ParametersError: If the name is unknown, or a file is missing, damaged, of another format, or holds bad values.
    """
    path = SENSORS / sensor if isinstance(sensor, str) and sensor in list_sensors() else Path(sensor)
    if not path.exists():
        raise ParametersError(
            f"{sensor}: no such folder; a folder with {TOML_NAME} and {NPZ_NAME} is needed, or one of the sensors "
            f"{', '.join(list_sensors())}"
        )
    path = path if path.suffix == ".toml" else path / TOML_NAME
    document = _read_toml(path)
    reader = _Reader(document, path)
    if reader.take("format") != FORMAT:
        raise ParametersError(f"{path}: format is {document['format']!r}; this version reads {FORMAT}")
    array = reader.build("array", lambda: _array(reader))
    tables = reader.build("cover", lambda: _tables(reader, path))
    operator = tables.pop(_OPERATOR, np.zeros(0))
    if operator.shape != (array.count, array.count):
        raise ParametersError(
            f"{path.parent / NPZ_NAME}: {_OPERATOR!r} has shape {operator.shape}; {array.count} texels take "
            f"{(array.count, array.count)}"
        )
    return reader.build(
        "parameters",
        lambda: Parameters(
            array=array,
            spread=reader.build("spread", lambda: _spread(reader, operator)),
            electronics=reader.build("electronics", lambda: _electronics(reader)),
            filter=reader.build("filter", lambda: _filter(document.get("filter"))),
            provenance=reader.build("provenance", lambda: dict(document.get("provenance", {}))),
            cells=reader.build("cells", lambda: _cells(document.get("cells"), tables)),
            tables={name: table for name, table in tables.items() if name not in _RESERVED},
        ),
    )


class _Reader:
    """Looks values up by dotted path and turns every failure into one line that names file and place."""

    def __init__(self, document: Mapping[str, Any], path: Path) -> None:
        self._document = document
        self._path = path

    def take(self, key: str) -> Any:  # noqa: ANN401 -- TOML values
        value: Any = self._document
        for part in key.split("."):
            if not isinstance(value, Mapping) or part not in value:
                raise ParametersError(f"{self._path}: {key} is missing")
            value = value[part]
        return value

    def build(self, place: str, make: Callable[[], T]) -> T:
        try:
            return make()
        except ParametersError:
            raise
        except (TypeError, ValueError, LookupError, ArithmeticError, AttributeError) as error:
            raise ParametersError(f"{self._path}: [{place}] {error}") from error


def _describe(parameters: Parameters, sha256: str) -> dict[str, Any]:
    document: dict[str, Any] = {
        "format": FORMAT,
        "array": _describe_array(parameters.array),
        "spread": _describe_spread(parameters.spread),
        "electronics": _plain(parameters.electronics),
        "cover": {"file": NPZ_NAME, "sha256": sha256},
    }
    if parameters.filter is not None:
        document["filter"] = _plain(parameters.filter)
    if parameters.cells is not None:
        plain = _plain(parameters.cells)
        document["cells"] = {name: value for name, value in plain.items() if name not in _CELL_TABLES}
    if parameters.provenance:
        document["provenance"] = _without_none(dict(parameters.provenance))
    return document


def _describe_array(array: TexelArray) -> dict[str, Any]:
    """Name, size and pitch; a mask and single positions only where they are not the plain grid's."""
    plain: dict[str, Any] = {
        "name": array.name,
        "rows": array.rows,
        "columns": array.columns,
        "pitch": list(array.pitch),
        "texel_size": list(array.texel_size),
    }
    if not array.active.all():
        plain["active"] = array.image(array.active).astype(int).tolist()
    grid = TexelArray.grid(array.rows, array.columns, array.pitch)
    if not (np.array_equal(array.centres, grid.centres) and np.array_equal(array.normals, grid.normals)):
        plain["centres"] = array.centres.tolist()
        plain["normals"] = array.normals.tolist()
    return plain


def _array(reader: _Reader) -> TexelArray:
    table = reader.take("array")
    pitch, size = reader.take("array.pitch"), reader.take("array.texel_size")
    grid = TexelArray.grid(
        reader.take("array.rows"),
        reader.take("array.columns"),
        (pitch[0], pitch[1]),
        texel_size=(size[0], size[1]),
        active=table.get("active"),
        name=reader.take("array.name"),
    )
    if "centres" not in table:
        return grid
    return dataclasses.replace(
        grid,
        centres=np.array(table["centres"], dtype=np.float64),
        normals=np.array(reader.take("array.normals"), dtype=np.float64),
    )


def _describe_spread(spread: Spread) -> dict[str, Any]:
    if isinstance(spread, Gaussian):
        return {"kind": "gaussian", **_plain(spread)}
    return {"kind": "operator", "source": getattr(spread, "source", type(spread).__name__)}


def _spread(reader: _Reader, operator: FloatArray) -> Spread:
    values = dict(reader.take("spread"))
    match values.pop("kind", None):
        case "gaussian":
            return Gaussian(**values)
        case "operator":
            return Tabulated(matrix=operator, **values)
        case kind:
            raise ValueError(f"kind is {kind!r}; it must be 'gaussian' or 'operator'")


def _electronics(reader: _Reader) -> Electronics:
    values = dict(reader.take("electronics"))
    for name in ("characteristic", "gains"):
        if name in values:
            values[name] = tuple(values[name])
    return Electronics(**values)


def _filter(values: Mapping[str, Any] | None) -> Butterworth | None:
    return None if values is None else Butterworth(**values)


def _cells(values: Mapping[str, Any] | None, tables: Mapping[str, FloatArray]) -> CoverCells | None:
    if values is None:
        return None
    named = {**values, "cell": tuple(values["cell"])}
    return CoverCells(compliance=tables[_COMPLIANCE], influence=tables[_INFLUENCE], table=tables.get(_TABLE), **named)


def _plain(instance: Any) -> dict[str, Any]:  # noqa: ANN401 -- any dataclass instance
    """A dataclass as TOML values; None is left out."""
    return _without_none(dataclasses.asdict(instance))


def _without_none(values: Mapping[str, Any]) -> dict[str, Any]:
    plain: dict[str, Any] = {}
    for key, value in values.items():
        if value is None:
            continue
        if isinstance(value, Mapping):
            plain[key] = _without_none(value)
        elif isinstance(value, np.generic | np.ndarray):
            plain[key] = value.tolist()
        else:
            plain[key] = list(value) if isinstance(value, tuple) else value
    return plain


def _tables(reader: _Reader, path: Path) -> dict[str, FloatArray]:
    name, sha256 = reader.take("cover.file"), reader.take("cover.sha256")
    if name != NPZ_NAME or not isinstance(sha256, str):
        raise ValueError(f"file must be {NPZ_NAME!r} and sha256 a text, not {name!r} and {sha256!r}")
    return _read_tables(path.parent / NPZ_NAME, sha256)


def _replace_pair(folder: Path, packed: bytes, text: bytes) -> None:
    """Replace both files so that a reader finds a pair that belongs together at every moment.

    Until the TOML file is replaced too, a copy of the old tables serves those who read the old one.

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
    """Where a copy of tables of this hash stands while the pair is being replaced."""
    return tables.with_name(f"{tables.stem}.{sha256[:16]}{tables.suffix}")


def _read_tables(path: Path, sha256: str) -> dict[str, FloatArray]:
    packed = _read(path)
    if hashlib.sha256(packed).hexdigest() != sha256:
        copy = _path_of_copy(path, sha256)
        if not copy.exists():
            raise ParametersError(f"{path}: does not belong to {TOML_NAME} (sha256 differs); write both anew")
        packed = _read(copy)
    try:
        with np.load(io.BytesIO(packed), allow_pickle=False) as archive:
            return {name: np.asarray(archive[name], dtype=np.float64) for name in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise ParametersError(f"{path}: not a readable npz file: {error}") from error


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(_read(path).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParametersError(f"{path}: not readable as TOML: {error}") from error


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ParametersError(
            f"{path}: {error.strerror}; a folder with {TOML_NAME} and {NPZ_NAME} is needed"
        ) from error
