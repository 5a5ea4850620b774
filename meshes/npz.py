"""Packing of numpy arrays into the bytes of an npz file."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt


def pack_npz(arrays: Mapping[str, npt.ArrayLike]) -> bytes:
    """Return the bytes of an npz file of arrays; they depend on names and values only, not on order or time of day.

    Args:
        arrays: Arrays by name, of any shape.

    Raises:
        ValueError: If an array holds Python objects.
    """
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, values in sorted(arrays.items()):
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asarray(values, order="C"), allow_pickle=False)
            # A ZipInfo made here has a fixed date; given a name, `ZipFile.writestr` would store the present time.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), content.getbuffer(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()
