"""Writes the pictures of a scene into an output folder, or says in one line why there are none."""

from __future__ import annotations

import logging
from pathlib import Path

from validation.scene.cover_scene import CoverScene

_LOG = logging.getLogger(__name__)


def write_scene(scene: CoverScene | None, folder: Path) -> tuple[str, ...]:
    """Write `cover.png` and `cover.gltf`; without pyvista or a renderer, warn in one line and write nothing.

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
        from validation.scene.draw import write_gltf, write_picture

        write_picture(scene, folder / "cover.png")
        write_gltf(scene, folder / "cover.gltf")
    except ImportError:
        _LOG.warning("no cover.png: pyvista is not installed; run: python -m pip install 'softcover[view]'")
        return ()
    except RenderingError as error:
        _LOG.warning("no cover.png: %s", error)
        return ()
    return ("cover.png", "cover.gltf")
