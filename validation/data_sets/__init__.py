"""Data sets: recordings of real sensors under known loads, described by a TOML file, and their scores."""
