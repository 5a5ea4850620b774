"""Comparison of the finite elements with measured forces of an indenter at known depths."""

from __future__ import annotations
