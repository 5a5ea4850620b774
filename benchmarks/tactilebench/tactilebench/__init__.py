"""Versioned truth for tactile arrays under soft covers, and a scorer that needs numpy alone."""

from tactilebench.case import BenchError, Body, Case, Cover, Layer, Motion, Truth, cases, load_truth, save_truth
from tactilebench.files import read_forces, write_template
from tactilebench.scoring import score, score_case

__all__ = [
    "BenchError",
    "Body",
    "Case",
    "Cover",
    "Layer",
    "Motion",
    "Truth",
    "cases",
    "load_truth",
    "read_forces",
    "save_truth",
    "score",
    "score_case",
    "write_template",
]
