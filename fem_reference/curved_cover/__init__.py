"""Solid covers: responses of all texels, and contact of rigid indenters from any direction."""

from __future__ import annotations

from fem_reference.curved_cover.responses import GridResponse, TexelResponses, texel_responses

__all__ = ["GridResponse", "TexelResponses", "texel_responses"]
