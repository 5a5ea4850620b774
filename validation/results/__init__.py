"""Results as models that write JSON and read it back, and whose fields say how they are printed."""

from validation.results.model import (
    DASH,
    Array,
    Bound,
    Column,
    GreyImage,
    Indices,
    JsonObject,
    Number,
    Result,
    Unread,
    columns,
    format_digits,
    renamed,
    result_model,
)

__all__ = [
    "DASH",
    "Array",
    "Bound",
    "Column",
    "GreyImage",
    "Indices",
    "JsonObject",
    "Number",
    "Result",
    "Unread",
    "columns",
    "format_digits",
    "renamed",
    "result_model",
]
