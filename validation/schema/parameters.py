"""Tables of `parameters.toml`, the parameters of a fast model, for editors; `fastmodel.load` reads such files itself.

The tables are those of the classes of `fastmodel`, so that this schema follows them.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fastmodel.parameters import FORMAT
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import Electronics
from fastmodel.validity import Validity
from validation.schema import Table
from validation.schema.types import TexelCount

_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_Vectors = list[Annotated[list[float], Field(min_length=3, max_length=3)]]


class ArraySection(Table):
    """The texels.

    Attributes:
        name: Name of the array.
        rows: Number of rows, along y.
        columns: Number of columns, along x.
        pitch: Distance between the centres of texels along x and y [m].
        texel_size: Sensitive rectangle of a texel along x and y [m].
        active: For each row of texels 0 or 1; 0 marks a missing texel; all measure when left out.
        centres: Centres of the texels [m], where they are no grid.
        normals: Unit normals of the texels, where they are no grid.
    """

    name: str
    rows: TexelCount
    columns: TexelCount
    pitch: _Pair
    texel_size: _Pair
    active: list[list[Annotated[int, Field(ge=0, le=1)]]] | None = None
    centres: _Vectors | None = None
    normals: _Vectors | None = None


class GaussianSection(Table):
    """A Gaussian spread kernel.

    Attributes:
        kind: The word gaussian.
        sigma_x: Standard deviation along x, in texel pitches.
        sigma_y: Standard deviation along y, in texel pitches.
        ksize_x: Size of the kernel along x, an odd number of texels.
        ksize_y: Size of the kernel along y, an odd number of texels.
    """

    kind: Literal["gaussian"]
    sigma_x: float
    sigma_y: float
    ksize_x: TexelCount
    ksize_y: TexelCount


class OperatorSection(Table):
    """A spread whose matrix is in `cover.npz`.

    Attributes:
        kind: The word operator.
        source: Origin of the matrix.
    """

    kind: Literal["operator"]
    source: str = ""


class CoverSection(Table):
    """The file with the large tables.

    Attributes:
        file: Name of the file.
        sha256: SHA-256 hash of the file.
    """

    file: Literal["cover.npz"]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class CurvedSection(Table):
    """A curved cover.

    Attributes:
        thickness: Thickness [m].
    """

    thickness: float


class ParametersTables(Table):
    """The parameters of a fast model, in SI units.

    Attributes:
        format: Version of the format.
        array: The texels.
        spread: The point spread of the cover.
        electronics: The conversion of texel forces to counts.
        cover: The file with the large tables.
        filter: Low-pass filter on the force of every texel.
        cells: Cells smaller than a texel, between which `cover.npz` has the compliance of the cover.
        curved: A curved cover.
        validity: The range in which the fast model agrees with the finite elements.
        provenance: Origin of the numbers.
    """

    MOST_BYTES: ClassVar[int] = 3 * 2**20

    format: Annotated[int, Field(ge=FORMAT, le=FORMAT)]
    array: ArraySection
    spread: GaussianSection | OperatorSection
    electronics: Electronics
    cover: CoverSection
    filter: Butterworth | None = None
    cells: dict[str, Any] | None = None
    curved: CurvedSection | None = None
    validity: Validity | Literal["not stated"] = "not stated"
    provenance: dict[str, Any] = Field(default_factory=dict)
