"""Measurements of force over depth that are made up in SI units."""

from meshes import Sphere
from validation.schema.measured_force import Measurement, PointTable, UncertaintyTable


def make_measurement(depths, forces, fitted, *, cover, uncertainty, **options):
    points = [
        PointTable.model_construct(depth=depth, force=force, use="fit" if use else "score")
        for depth, force, use in zip(depths, forces, fitted, strict=True)
    ]
    stated = UncertaintyTable.model_construct(**uncertainty)
    return Measurement.model_construct(
        name="made up", indenter=Sphere(radius=7e-3), cover=cover, point=points, uncertainty=stated, **options
    )
