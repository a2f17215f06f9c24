"""Velocity transfer between points and body grids: PIC, FLIP and APIC, which differ in the transfer to the points.

A transfer is a function (body grids, before, after, v) -> (v, C). From the nodal velocities (2 nodes,) before and
after the step and the velocities v (2, n) of points [m/s] it computes new velocities of points and their affine
velocity field C (2, 2, n) [1/s]. Nodes of body grids that are built once go on from their own velocities where the
points have what APIC makes of these (`nodal_velocity`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.grid import BodyGrids

Array = NDArray[np.float64]
Transfer = Callable[[BodyGrids, Array, Array, Array], tuple[Array, Array]]


def to_nodes(assembly: Assembly, mass: Array, v: Array, C: Array) -> Array:
    """Nodal velocities (2 nodes,) from the affine momenta of points (Nezamabadi et al. 2017, eq. 7, for C = 0).

    Jiang et al., ACM ToG 34 (2015), eq. 8: P_i = sum_p m_p N_ip (v_p + C_p (X_i - X_p)). `mass` (n,) [kg/m].
    """
    if C.any():
        momentum = assembly.grid.affine_momentum(mass, v, C)
    else:
        momentum = np.asarray(assembly.grid.interpolation.T @ (mass * v).T).ravel()
    return np.asarray(momentum / np.maximum(assembly.lumped, 1e-300))


def nodal_velocity(assembly: Assembly, mass: Array, v: Array, C: Array, *, known: Array) -> Array:
    """Nodal velocities (2 nodes,): `known` ones of bodies whose v and C are those of `apic`, of others by `to_nodes`.

    Points keep only the linear part of the velocity in a cell. `to_nodes` loses the bilinear part, and with it energy
    in every step, whatever its length, where a body contracts across its axis.
    """
    grid = assembly.grid
    if not (known.size and C.any()):
        return to_nodes(assembly, mass, v, C)
    others = (grid.at_points(known) != v).any(axis=0)
    if others.all():
        return to_nodes(assembly, mass, v, C)
    others |= (grid.gradient_at_points(known) != C).any(axis=(0, 1))
    if not others.any():
        return known.copy()
    changed = np.zeros(grid.bodies, dtype=bool)
    changed[grid.cell_body[grid.cell_of_point[others]]] = True
    return np.where(np.repeat(changed[grid.node_body], 2), to_nodes(assembly, mass, v, C), known)


def pic(grid: BodyGrids, before: Array, after: Array, v: Array) -> tuple[Array, Array]:
    """Points take the new nodal velocity: smooth, with numerical damping that depends on the time step."""
    return grid.at_points(after), np.zeros((2, 2, v.shape[1]))


def flip(grid: BodyGrids, before: Array, after: Array, v: Array) -> tuple[Array, Array]:
    """Points take the change of the nodal velocity: no damping, but velocities the grid does not resolve persist.

    Brackbill & Ruppel, J. Comput. Phys. 65 (1986).
    """
    return v + grid.at_points(after - before), np.zeros((2, 2, v.shape[1]))


def apic(grid: BodyGrids, before: Array, after: Array, v: Array) -> tuple[Array, Array]:
    """PIC with an affine velocity field at the points, which conserves angular momentum.

    Jiang et al., ACM ToG 34 (2015); for Q1 shape functions their B D^-1 is the gradient of the nodal velocity field.
    """
    return grid.at_points(after), grid.gradient_at_points(after)
