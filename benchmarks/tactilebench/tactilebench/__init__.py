"""Versioned truth for tactile arrays under soft covers, and a scorer that needs numpy alone."""

from tactilebench.case import BenchError, Body, Case, Cover, Layer, Motion, Truth, cases, load_truth, save_truth

__all__ = ["BenchError", "Body", "Case", "Cover", "Layer", "Motion", "Truth", "cases", "load_truth", "save_truth"]
