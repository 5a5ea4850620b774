"""Frames from real sensors: one result type, one reader per file format, and labelled series of them."""

from validation.recordings.recording import RecordedArray, Recording, RecordingError

__all__ = ["RecordedArray", "Recording", "RecordingError"]
