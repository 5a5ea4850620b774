"""Check of values of JSON against score.schema.json of tactilebench, for the keywords that this schema has."""

import json
import re
from pathlib import Path

import tactilebench

SCHEMA = json.loads((Path(tactilebench.__file__).parent / "score.schema.json").read_text())
KINDS = {"object": dict, "array": list, "string": str, "number": float, "null": type(None), "integer": int}


def check_scores(value, form=SCHEMA):
    form = SCHEMA["$defs"][form["$ref"].split("/")[-1]] if "$ref" in form else form
    names = [form["type"]] if isinstance(form["type"], str) else form["type"]
    assert isinstance(value, tuple(KINDS[name] for name in names)), (value, form)
    if isinstance(value, dict):
        assert set(form.get("required", ())) <= set(value)
        for key, each in value.items():
            check_scores(each, form.get("properties", {}).get(key) or form["additionalProperties"])
    for each in value if isinstance(value, list) else ():
        check_scores(each, form["items"])
    if "pattern" in form:
        assert re.match(form["pattern"], value)
