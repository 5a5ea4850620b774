import json


def test_doctor_lists_versions_by_part(softcover):
    status, out, _ = softcover("doctor", "--json")
    assert status == 0
    assert json.loads(out)["parts"]["base"]["mujoco"]
