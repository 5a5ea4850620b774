"""Write texels and tops of the solid covers: `python benchmarks/tactilebench/geometry.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from meshes.solids import fingertip, flat_pad, phalanx

TARGET = Path(__file__).parent / "tactilebench" / "data" / "geometry.npz"
#: Corners of the eight triangles of a quadrilateral of 9 nodes, counterclockwise as the quadrilateral.
SPLIT = [(a, b, c) for i in (0, 1, 3, 4) for a, b, c in ((i, i + 1, i + 4), (i, i + 4, i + 3))]


def main() -> None:
    """Write the file: of each cover the thickness, rows, columns, pitch and texel size, the texels, and the top."""
    arrays = {}
    for made in (fingertip(), phalanx(), flat_pad()):
        mesh, texels = made.mesh(), made.texels
        used, faces = np.unique(mesh.top[:, np.array(SPLIT)].reshape(-1, 3), return_inverse=True)
        sizes = [made.thickness, texels.rows, texels.columns, *texels.pitch, *texels.texel_size]
        arrays |= {
            f"{texels.name}/sizes": np.array(sizes),
            f"{texels.name}/centres": texels.centres,
            f"{texels.name}/normals": texels.normals,
            f"{texels.name}/vertices": mesh.nodes[used],
            f"{texels.name}/faces": faces.reshape(-1, 3).astype(np.int32),
        }
    np.savez_compressed(TARGET, **arrays)  # type: ignore[arg-type]
    print(f"{TARGET.name}: {TARGET.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
