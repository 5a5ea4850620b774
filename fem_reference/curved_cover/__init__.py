"""Reference solutions of curved covers: responses of all texels, and rigid indenters from any direction."""

from __future__ import annotations

from fem_reference.curved_cover.finite_strain import press_curved_finite
from fem_reference.curved_cover.press import CurvedIndentation, press_curved
from fem_reference.curved_cover.responses import GridResponse, TexelResponses, texel_responses

__all__ = [
    "CurvedIndentation",
    "GridResponse",
    "TexelResponses",
    "press_curved",
    "press_curved_finite",
    "texel_responses",
]
