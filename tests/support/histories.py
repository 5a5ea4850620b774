"""Moving cases of a ball of 5 mm radius."""

from meshes import Pose, Sphere
from validation.moving.history import MovingCase


def make_case(times, loads, places, repeat=1):
    """Instants [s], load [N] and place [m] at each of them, and how often the history happens."""
    poses = tuple(Pose.planar(at=at) for at in places)
    return MovingCase(
        name="case", indenter=Sphere(radius=5e-3), shape="sphere:radius=5mm", times=times, values=loads, poses=poses,
        repeat=repeat,
    )  # fmt: skip
