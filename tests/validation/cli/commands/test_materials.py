import json

import pytest


def test_materials(softcover):
    status, out, _ = softcover("materials", "--json")
    assert status == 0
    assert json.loads(out)["materials"]["dragon-skin-30"]["youngs_modulus"] == pytest.approx(669e3)
    assert "dragon-skin-30" in softcover("materials")[1]
