"""Isochromatics: what a photoelastic experiment shows between crossed circular polarisers.

The light is sin^2(pi N), where N is the difference of the principal stresses in the plane over that of one fringe
(Frocht, Photoelasticity, volume 1, 1941). Stresses at points jump between cells. Here they are projected on a grid of
cells for each body: weighted means at its nodes, corrected once by the means of what they leave.
"""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.grid import build_grids
from skmpm.plot.snapshot import Snapshot

PARTS = 4  # of the sides of triangles: a fringe as narrow as the distance of points is drawn smoothly


def stress_differences(seen: Snapshot) -> Array:
    """(s_xx - s_yy, 2 s_xy) at the points, (2, n) [Pa], continuous in each body; those of rigid bodies are zero.

    These components are smooth where their length, the difference of the principal stresses in the plane, has kinks.
    """
    out, soft, stress = np.zeros_like(seen.x), seen.inside_deformable, seen.fields["stress"]()
    if not soft.any():
        return out
    grid = build_grids(seen.x[:, soft], seen.owner[soft], seen.cell(), seen.deformable.size)
    to_points, weight = grid.interpolation, seen.fields["volume"]()[soft]
    total = np.maximum(to_points.T @ weight, np.finfo(float).tiny)[:, None]
    given = np.stack([stress[0, 0] - stress[1, 1], 2.0 * stress[0, 1]])[:, soft].T
    found = np.zeros_like(given)
    for _ in range(2):
        found = found + to_points @ ((to_points.T @ (weight[:, None] * (given - found))) / total)
    out[:, soft] = found.T
    return out


def light(order: Array) -> Array:
    """The light (n,) of fringe orders (2, n), between 0 and 1."""
    return np.asarray(np.sin(np.pi * np.hypot(*order)) ** 2)


def divided(x: Array, corners: Ints, values: Array) -> tuple[Array, Ints, Array]:
    """Triangles (t, 3) divided into `PARTS`^2 each: corners (2, k) [m], triangles, and linear values (2, k)."""
    steps = np.arange(PARTS + 1)
    first, second = (each[steps[:, None] + steps <= PARTS] for each in np.meshgrid(steps, steps, indexing="ij"))
    shares = np.stack([PARTS - first - second, first, second]) / PARTS
    number = np.full((PARTS + 2, PARTS + 2), -1)
    number[first, second] = np.arange(first.size)
    i, j = first[first + second < PARTS], second[first + second < PARTS]
    upward = np.stack([number[i, j], number[i + 1, j], number[i, j + 1]], axis=1)
    downward = np.stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], axis=1)
    pattern = np.concatenate([upward, downward[(downward >= 0).all(axis=1)]])
    fine = (pattern + first.size * np.arange(len(corners))[:, None, None]).reshape(-1, 3)
    there, known = (np.einsum("itc,cs->its", each[:, corners], shares).reshape(2, -1) for each in (x, values))
    return there, fine, known
