"""Choose the outer boundary of the meshes of a wide cover, where all displacements are zero."""

from __future__ import annotations

from fem_reference.linear_response.surface_compliance import decay_length, membrane_length
from meshes import Cover

#: Distance of the outer boundary over the decay length of the cover's response: part of the radius of axisymmetric
#: meshes, and distance from the contact in three dimensions [-].
_REACH, _SOLID_REACH = 12.0, 7.0
#: Part of the radius of axisymmetric meshes that is proportional to the contact radius, over the contact radius [-].
_REACH_RADII = 1.5
#: Part of the radius of axisymmetric meshes that is proportional to the membrane length of a stiff top layer, where the
#: top is held sideways by friction [-].
_REACH_IN_PLANE = 4.0
#: Radius of axisymmetric meshes on a sliding base, where the response decays only with the square of the distance, over
#: the sum of decay length and contact radius; the outer boundary then changes forces by less than 0.005 % [-].
_REACH_SLIDING = 40.0
#: Least radius of axisymmetric meshes for a stiff top layer: over the distance over which the stretch of that layer
#: decays, which leaves 0.1 % of the texel forces, and at most so many thicknesses, because the factorisation fails for
#: longer elements [-].
_REACH_MEMBRANE, _LONGEST = 0.3, 40.0


def choose_linear_reach(cover: Cover, contact_radius: float) -> float:
    """Choose the radius of an axisymmetric mesh for linear solutions, where a stiff top layer does not stretch [m].

    Args:
        cover: Laterally wide cover.
        contact_radius: Estimated radius of the largest contact [m].
    """
    decay = decay_length(cover)
    if cover.base == "sliding":
        return _REACH_SLIDING * (decay + contact_radius)
    return _REACH * decay + _REACH_RADII * contact_radius


def choose_friction_reach(cover: Cover, contact_radius: float) -> float:
    """Choose the radius of an axisymmetric mesh for linear solutions with shear tractions on the top [m].

    Args:
        cover: Laterally wide cover.
        contact_radius: Estimated radius of the largest contact [m].
    """
    stretch = _REACH_IN_PLANE * membrane_length(cover) + _REACH_RADII * contact_radius
    return max(choose_linear_reach(cover, contact_radius), stretch)


def choose_reach(cover: Cover, contact_radius: float) -> float:
    """Choose the radius of an axisymmetric mesh [m].

    Args:
        cover: Laterally wide cover.
        contact_radius: Estimated radius of the largest contact [m].
    """
    stretch = min(_REACH_MEMBRANE * membrane_length(cover), _LONGEST * cover.thickness)
    return max(choose_linear_reach(cover, contact_radius), stretch)


def choose_solid_reach(cover: Cover) -> float:
    """Choose the distance from the contact to the outer boundary of a mesh in three dimensions [m]."""
    return (_REACH_SLIDING if cover.base == "sliding" else _SOLID_REACH) * decay_length(cover)


def warn_of_boundary(cover: Cover) -> tuple[str, ...]:
    """State that a stiff foil reaches beyond the outer boundary of the meshes, if it does."""
    wanted = _REACH_MEMBRANE * membrane_length(cover)
    if wanted <= max(_LONGEST * cover.thickness, _REACH * decay_length(cover)):
        return ()
    sentence = (
        f"the stiff top reaches {wanted * 1e3:.3g} mm in its plane, beyond the fixed outer boundary of the mesh: the "
        "cover is stiffer than a wide one, which no error estimate contains"
    )
    return (sentence,)
