"""The texel array as an MJCF file, as the fast model makes it."""

from __future__ import annotations

from pathlib import Path

import fastmodel
from fastmodel import Parameters
from validation.folder import write_text


def write_mjcf(parameters: Parameters, path: Path, *, name: str) -> None:
    """Write a model that holds the sensor on one body and loads in MuJoCo as it is.

    The file carries what MuJoCo can express, the rigid texels; spread, filter and electronics are in
    `parameters.toml` and are applied by `fastmodel`.

    Args:
        parameters: The sensor.
        path: The file.
        name: Name of the model; its body carries the sensor and its texels are named after it.

    Raises:
        OSError: If the file cannot be written.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = name
    body = spec.worldbody.add_body(name=name)
    fastmodel.attach(spec, body, parameters, name=name, contact="boxes")
    spec.compile()
    text = spec.to_xml()
    # What a reader gets must be what was meant: load it back before anybody else does.
    model = mujoco.MjModel.from_xml_string(text)
    texels = int(parameters.array.active.sum())
    if model.ngeom < texels:
        raise RuntimeError(f"the model lost texels on its way to {path}: {model.ngeom} of {texels} geoms")
    write_text(path, text)
