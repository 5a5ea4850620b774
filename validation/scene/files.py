"""Writes the pictures of a scene into an output folder, or says in one line why there are none."""

from __future__ import annotations

import logging
from pathlib import Path

from validation.extras import MissingExtraError
from validation.scene.cover_scene import CoverScene

_LOG = logging.getLogger(__name__)


def write_scene(scene: CoverScene | None, folder: Path) -> tuple[str, ...]:
    """Write `cover.png`, `cover.gltf` and, for ParaView, `cover.vtu`.

    Without pyvista nothing is written, without a renderer no picture; one line of warning says so.

    Args:
        scene: What is drawn; None for nothing.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    from validation.scene.rendering import RenderingError

    if scene is None:
        return ()
    try:
        from validation.scene.draw import make_grid, write_gltf, write_picture

        make_grid(scene).save(folder / "cover.vtu")
        write_picture(scene, folder / "cover.png")
        write_gltf(scene, folder / "cover.gltf")
    except ImportError:
        _LOG.warning("no cover.png: %s", MissingExtraError("pyvista"))
        return ()
    except RenderingError as error:
        _LOG.warning("no cover.png: %s", error)
        return ("cover.vtu",)
    return ("cover.png", "cover.gltf", "cover.vtu")


def lacks_picture(files: tuple[str, ...]) -> bool:
    """Return whether a picture is missing among written files because this machine cannot draw."""
    return "cover.vtu" in files and "cover.png" not in files
