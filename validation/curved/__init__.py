"""Curved covers from sensor file to result: body and meshes, texel responses, presses from any direction, and files."""
