"""The tactile array as an MJCF file, as the fast model makes it."""

from __future__ import annotations

from pathlib import Path

import fastmodel
from fastmodel import Parameters
from fastmodel.contact.interface import TexelContact
from validation.output_folder import write_text


def write_mjcf(parameters: Parameters, path: Path, *, name: str, method: str | TexelContact = "default") -> None:
    """Write a model that holds the sensor on one body and loads in MuJoCo as it is.

    The file carries what MuJoCo can express: the rigid plate of the contact methods `cover` and `foundation`, or the
    rigid texels of `area` and `boxes`.  Sharing, spread, filter and electronics are in `parameters.toml` and are
    applied by `fastmodel`.

    Args:
        parameters: The sensor.
        path: The file.
        name: Name of the model; its body carries the sensor and its geoms are named after it.
        method: Contact method, by name or as settings.

    Raises:
        FastModelError: If the contact method does not go with the parameters.
        OSError: If the file cannot be written.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = name
    body = spec.worldbody.add_body(name=name)
    fastmodel.attach(spec, body, parameters, name=name, contact=method)
    geoms = spec.compile().ngeom
    text = spec.to_xml()
    # What a reader gets must be what was meant: load it back before anybody else does.
    model = mujoco.MjModel.from_xml_string(text)
    if model.ngeom != geoms:
        raise RuntimeError(f"the model changed on its way to {path}: {model.ngeom} geoms, not {geoms}")
    write_text(path, text)
