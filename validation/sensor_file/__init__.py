"""Sensor files: one TOML file describes array, cover and electronics."""
