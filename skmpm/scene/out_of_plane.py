"""The out-of-plane stress of plane strain, and the equivalent stress, which needs it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skmpm.arrays import ROUND_OFF, Array, Ints
from skmpm.material import Material, determinant, has_memory, initial_state, is_linear, poisson_ratio
from skmpm.scene.scene import Scene
from skmpm.scene.state import State


def stress_zz(scene: Scene, state: State) -> Array:
    """Out-of-plane Cauchy stress of plane strain, (n,) [Pa]; nan where a material does not say, 0 in rigid bodies.

    Where dilatation is averaged, the pressure is that of the mean dilatation and not of the deformation gradient of
    the point: what it adds to the mean stress in the plane it adds to the one out of it. So that of linear materials
    is (sigma_xx + sigma_yy) / 2 - mu tr(F - I), and where body grids have been built again, so that their strain
    is no function of F, nu (sigma_xx + sigma_yy), which is that of the point. Others have it from their `stress_zz`.
    """
    out = np.zeros(state.x.shape[1])
    deformable = np.flatnonzero(scene.deformable[scene.owner])
    for material, points in scene.points_by_material:
        own = deformable[points]
        if is_linear(material):
            out[own] = _of_linear(material, state, own)
        else:
            known = getattr(material, "stress_zz", None)
            out[own] = np.nan if known is None else _by_material(known, material, state, own)
    return out


def _of_linear(material: Material, state: State, own: Ints) -> Array:
    """The out-of-plane stress of a linear material at some points."""
    in_plane = state.stress[0, 0, own] + state.stress[1, 1, own]
    if (state.F_anchor[:, :, own] != np.eye(2)[:, :, None]).any():
        return np.asarray(poisson_ratio(material) * in_plane)
    _, mu = material.lame
    return np.asarray(0.5 * in_plane - mu * (state.F[0, 0, own] + state.F[1, 1, own] - 2.0))


def _by_material(known: Callable[..., Array], material: Material, state: State, own: Ints) -> Array:
    """The stress that the `stress_zz` of a material knows, at some points."""
    stress = state.stress[:, :, own]
    if has_memory(material):
        return known(stress, state.internal[: initial_state(material).shape[0], own])
    F = state.F[:, :, own]
    in_plane = np.einsum("ijn,ijn->n", material.stress(F), F) / determinant(F)
    more = 0.5 * (stress[0, 0] + stress[1, 1] - in_plane)
    averaged = np.abs(more) > ROUND_OFF * np.abs(stress).max(initial=0.0)
    return np.asarray(known(F) + np.where(averaged, more, 0.0))


def mises(stress: Array, zz: Array) -> Array:
    """Equivalent stress of von Mises, (3/2 s : s)^(1/2) with the deviator s in three dimensions, (n,) [Pa].

    Parameters
    ----------
    stress : (2 or 3, 2 or 3, n) Cauchy stress in the plane [Pa]
    zz : (n,) that out of the plane
    """
    xx, yy, xy = stress[0, 0], stress[1, 1], stress[0, 1]
    return np.asarray(np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2))
