import json


def test_doctor(softcover):
    status, out, _ = softcover("doctor", "--json")
    assert status == 0
    assert json.loads(out)["parts"]["base"]["mujoco"]
