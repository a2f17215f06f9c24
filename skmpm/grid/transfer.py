"""Velocity transfer between points and body grids (APIC).

Points have a velocity v (2, n) [m/s] and its gradient C (2, 2, n) [1/s]. Nodes of body grids that are built once go
on from their own velocities where the points have what `to_points` makes of these (`nodal_velocity`).
"""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array
from skmpm.grid import BodyGrids
from skmpm.grid.assembly import Assembly


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
    """Nodal velocities (2 nodes,): `known` ones of bodies whose points have what `to_points` makes of them.

    Others by `to_nodes`. Points keep only the linear part of the velocity in a cell. `to_nodes` loses the bilinear
    part, and with it energy in every step, whatever its length, where a body contracts across its axis.
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


def to_points(grid: BodyGrids, nodal: Array) -> tuple[Array, Array]:
    """Velocities of points and their gradients from nodal velocities, by APIC.

    Parameters
    ----------
    grid : body grids of the points
    nodal : (2 nodes,) velocities of the nodes [m/s]

    Returns
    -------
    v : (2, n) velocities [m/s]
    C : (2, 2, n) their gradients [1/s]

    Notes
    -----
    Jiang et al., ACM ToG 34 (2015); for Q1 shape functions their B D^-1 is the gradient of the nodal velocity field.
    So angular momentum is conserved.
    """
    if nodal.shape != (2 * grid.nodes,):
        raise ValueError(
            f"to_points: nodal has the shape {nodal.shape}; give velocities ({2 * grid.nodes},) of nodes"
        )
    return grid.at_points(nodal), grid.gradient_at_points(nodal)
