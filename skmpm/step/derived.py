"""What follows from a reference configuration: body grids, weights, supports; and the bulk energy on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array
from skmpm.grid import BodyGrids
from skmpm.grid.assembly import prepare
from skmpm.grid.moment_fitting import fitted_places, fitted_weights
from skmpm.grid.supports import Elimination, eliminate, inner_nodes
from skmpm.material import bounded_modulus
from skmpm.outline.cells import cell_moments
from skmpm.scene import Derived, Scene, State, support_arms
from skmpm.scheme import Scheme, averages_dilatation
from skmpm.step.bulk import Bulk


def derived_data(scene: Scene, scheme: Scheme, x: Array, volume: Array) -> Derived:
    """Body grids in the reference configuration, and the data that depend only on it.

    There the points have the positions `x` (2, n) [m] and the volumes `volume` (n,) [m2].
    """
    own, grid = scene.deformable_points, scene.body_grids(x)
    weights = volume[own]
    if scheme.moment_fitting:
        weights, grid = fitted(scene, grid, weights, x)
    modulus = ghost_moduli(scene, scheme, grid)
    return Derived(
        assembly=prepare(grid, weights, scene.masses[own], modulus),
        ghost=modulus,
        moment_fitting=scheme.moment_fitting,
        supports=_supports(scene, grid),
        supporting=scene.supporting,
    )


def fitted(scene: Scene, grid: BodyGrids, volume: Array, x: Array) -> tuple[Array, BodyGrids]:
    """Quadrature weights (n,) of the points by moment fitting, and the grids with the places where strains are taken.

    Bodies without outline keep their volumes and places.
    """
    boundary = scene.outlines
    bounded = scene.outlined[grid.cell_body][grid.cell_of_point]
    if not bounded.any():
        return volume, grid
    moments = cell_moments(boundary, x[:, boundary.point], scene.cell, grid.cell_index, grid.cell_body)[:3]
    weights = np.where(bounded, fitted_weights(grid, volume, moments), volume)
    places = np.where(bounded, fitted_places(grid, weights, moments), grid.local)
    return weights, replace(grid, quadrature=places)


def _supports(scene: Scene, grid: BodyGrids) -> Elimination | None:
    """Elimination of the constraints N(c) v = prescribed velocity, for each prescribed component at every point c."""
    if not scene.supports:
        return None
    count = len(scene.supports)
    rows, entries, size = [], [], 0
    for i, (free, supported) in enumerate(zip(scene.free_components, scene.supported, strict=True)):
        at = grid.interpolation[scene.among_deformable[supported.points]]
        for axis in np.flatnonzero(~free).tolist():
            rows.append(sp.kron(at, np.eye(2)[axis : axis + 1], format="csr"))
            fields = {2 * i + axis: np.ones(supported.points.size)}
            if i in scene.turning:
                first = 2 * (count + int(np.searchsorted(scene.turning, i)))
                x, y = support_arms(scene, i, supported.points)
                fields |= {first: (x, y)[axis], first + 1: (-y, x)[axis]}
            own = size + np.arange(supported.points.size)
            entries += [(values, own, np.full(own.size, column)) for column, values in fields.items()]
            size += own.size
    values, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    B = sp.csr_array((values, (row, column)), shape=(size, 2 * (count + scene.turning.size)))
    known = _inside(scene, grid, B.shape[1])
    return eliminate(sp.csr_array(sp.vstack(rows)), B, known, grid.blocks, grid.rigid_motions)


def _inside(scene: Scene, grid: BodyGrids, columns: int) -> sp.csr_array:
    """What supports that do not turn prescribe at nodes inside of held areas, (2 nodes, columns)."""
    rows, prescribed = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for i, (free, supported) in enumerate(zip(scene.free_components, scene.supported, strict=True)):
        if i in scene.turning:
            continue
        held = np.zeros(grid.interpolation.shape[0], dtype=bool)
        held[scene.among_deformable[supported.points]] = True
        inner = np.flatnonzero(inner_nodes(grid.interpolation, held))
        for axis in np.flatnonzero(~free).tolist():
            rows.append(2 * inner + axis)
            prescribed.append(np.full(inner.size, 2 * i + axis))
    row, first = np.unique(np.concatenate(rows), return_index=True)
    entries = np.ones(row.size), (row, np.concatenate(prescribed)[first])
    return sp.csr_array(entries, shape=(2 * grid.nodes, columns))


def ghost_moduli(scene: Scene, scheme: Scheme, grid: BodyGrids) -> Array:
    """Moduli of the ghost penalties of the cells, (cells,) [Pa]: of the softest material in each."""
    modulus = np.full(grid.cell_body.size, np.inf)
    for material, points in scene.points_by_material:
        cells = grid.cell_of_point[points]
        modulus[cells] = np.minimum(modulus[cells], bounded_modulus(material))
    return np.asarray(scheme.ghost * modulus)


def bulk_of(scene: Scene, state: State, scheme: Scheme) -> Bulk:
    """The deformable bodies' energy, grouped by material."""
    own, parts = scene.deformable_points, scene.points_by_material
    F, stress = state.F_anchor[:, :, own], state.stress_anchor[:, :, own]
    undeformed = bool((np.eye(2)[:, :, None] == F).all())
    reference = (None if undeformed else F, stress if stress.any() else None)
    averaged = tuple(averages_dilatation(scheme, material) for material, _ in parts)
    internal = state.internal[:, own] if state.internal.size else None
    mixed = bool(scene.composite.any())
    return Bulk(state.grids.assembly, parts, *reference, averaged, mixed_cells=mixed, internal=internal)
