"""Results of models on recordings: rows of the table of scores, example images, and all scores of a data set."""

from __future__ import annotations

from collections.abc import Mapping

from fastmodel import Electronics
from validation.campaign.pooling import Pooled
from validation.data_sets.count_score import CountScore
from validation.results import GreyImage, Number, Result, result_model


@result_model
class RecordingRow(Result):
    """Row of the table of scores: one model on one split of the recordings into fitted and scored ones.

    Attributes:
        split: Name of the split.
        model: Name of the model.
        kind: `model` (forward model), `null` (null model) or `floor` (repeatability of the recordings).
        texel_gains: Whether a gain per texel was fitted.
        fitted: Names of the recordings that the model was fitted to.
        parameters: The fitted parameters, by name with unit.
        per_case: Score of each scored case, the mean over its repeated recordings, by name.
        pooled: Mean score over the scored cases with its bootstrap interval, by metric.
        skill: 1 - (changed grey of this model) / (changed grey of a null model), by name of the null model [-].
        electronics: The fitted curve as electronics of the fast model; None for rows without one.
    """

    split: str
    model: str
    kind: str
    texel_gains: bool
    fitted: tuple[str, ...]
    parameters: Mapping[str, Number]
    per_case: Mapping[str, CountScore]
    pooled: Mapping[str, Pooled]
    skill: Mapping[str, Pooled]
    electronics: Electronics | None


@result_model
class RecordingExample(Result):
    """Tactile images of one scored recording: the recorded image and the image that each model predicts.

    Attributes:
        split: Name of the split.
        case: Name of the recording.
        load: Load [N].
        recorded: Grey levels of the recorded mean frame, shape (rows, columns) [-].
        predicted: Predicted grey levels by name of the model, each of shape (rows, columns) [-].
    """

    split: str
    case: str
    load: Number
    recorded: GreyImage
    predicted: Mapping[str, GreyImage]


@result_model
class RecordingScores(Result):
    """All scores on the recordings of a data set.

    Attributes:
        name: Name of the data set.
        rows: Rows of the table of scores, one per split and model.
        examples: Images of one scored recording per split.
        about: Description of each model and each split in one line, by name.
        notes: Comparison with null models, and what the fitted recordings determine, by name of the split.
        files: SHA-256 hash of each recording, by name of the recording.
        noise: Root mean square over recordings of the standard deviation of a texel's counts [counts].
        source: Where the recordings were published.
        problems: One line per recording, series or split that was left out.
    """

    name: str
    rows: tuple[RecordingRow, ...]
    examples: tuple[RecordingExample, ...]
    about: Mapping[str, str]
    notes: Mapping[str, tuple[str, ...]]
    files: Mapping[str, str]
    noise: Number
    source: str
    problems: tuple[str, ...]

    def row(self, split: str, model: str, *, texel_gains: bool = False) -> RecordingRow:
        """Return the row of a model on a split, with or without texel gains.

        Raises:
            KeyError: If the table has no such row.
        """
        for row in self.rows:
            if (row.split, row.model, row.texel_gains) == (split, model, texel_gains):
                return row
        raise KeyError(f"no row {model!r} in split {split!r}; rows: {sorted({r.model for r in self.rows})}")
