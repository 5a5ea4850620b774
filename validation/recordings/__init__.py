"""Recordings of real sensors: the common data types, one reader per file format, and the recorder."""

from validation.recordings.recording import RecordedArray, Recording, RecordingError, Setup

__all__ = ["RecordedArray", "Recording", "RecordingError", "Setup"]
