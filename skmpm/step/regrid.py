"""Building of body grids at the points of a state, and the bulk energy on them.

The grids are built in a reference configuration, the anchor (`Scheme.anchor`): `State.x_anchor`, `F_anchor` and
`stress_anchor` are the positions, deformation gradients and stresses that the points had there. Regridding makes the
current configuration the reference configuration.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from skmpm import outline
from skmpm.arrays import Array, Ints
from skmpm.contact import acts_at_grid_nodes, joined_parts
from skmpm.grid import BodyGrids, build_grids
from skmpm.grid.assembly import prepare
from skmpm.grid.moment_fitting import fitted_places, fitted_weights
from skmpm.grid.supports import Elimination, eliminate
from skmpm.material import bounded_modulus, determinant, inverse, product
from skmpm.scene import Derived, Scene, SceneError, State
from skmpm.scheme import Scheme, averages_dilatation
from skmpm.step.bulk import Bulk
from skmpm.step.errors import StepRejected


def regridded_state(scene: Scene, state: State, scheme: Scheme) -> tuple[State, bool]:
    """The state with body grids, and whether the reference configuration was updated.

    It is updated if the deformation from it exceeds `scheme.anchor`, and set in a state without grids. Grids that
    belong to another scene or scheme are rebuilt in the same reference configuration.
    """
    regridding = state.displacement.size == 0 or _reference_is_outdated(state, scheme)
    if not regridding and _still_valid(scene, state, scheme):
        return state, False
    if regridding:
        state = replace(
            state,
            C=product(state.C, inverse(_deformation_since_anchor(scene, state, scheme))),
            x_anchor=state.x,
            F_anchor=state.F,
            stress_anchor=state.stress,
            displacement=np.zeros(0),
            nodal_velocity=np.zeros(0),
            factored=None,
        )
    derived = _at_anchor(scene, state, scheme)
    nodes = derived.assembly.grid.nodes
    displacement = state.displacement if state.displacement.size else np.zeros(2 * nodes)
    if displacement.size != 2 * nodes:
        raise SceneError(
            f"the state has {displacement.size // 2} grid nodes, the scene with cell = {scene.cell:g} m has"
            f" {nodes}; continue with the scene that the state was made from"
        )
    return replace(state, displacement=displacement, derived=derived), regridding


def _deformation_since_anchor(scene: Scene, state: State, scheme: Scheme) -> Array:
    """Deformation gradients at the points, where their velocity gradients are, relative to the anchor, (2, 2, n)."""
    relative = np.broadcast_to(np.eye(2)[:, :, None], state.F.shape).copy()
    if state.displacement.size:
        kept = state.derived or _at_anchor(scene, state, scheme)  # of a state from a file
        relative[..., scene.deformable_points] += kept.assembly.grid.gradient_at_points(state.displacement)
    return relative


def _still_valid(scene: Scene, state: State, scheme: Scheme) -> bool:
    """Whether the derived data of a state belong to this scene and scheme."""
    kept = state.derived
    return (
        kept is not None
        and kept.assembly.grid.cell == scene.cell
        and np.array_equal(kept.supporting, scene.supporting)
        and kept.moment_fitting == scheme.moment_fitting
        and np.array_equal(kept.ghost, _ghost_moduli(scene, scheme, kept.assembly.grid))
    )


def _at_anchor(scene: Scene, state: State, scheme: Scheme) -> Derived:
    return derived_data(scene, scheme, state.x_anchor, scene.initial_volumes * determinant(state.F_anchor))


def derived_data(scene: Scene, scheme: Scheme, x: Array, volume: Array) -> Derived:
    """Body grids in the reference configuration, and the data that depend only on it.

    There the points have the positions `x` (2, n) [m] and the volumes `volume` (n,) [m2].
    """
    own = scene.deformable_points
    grid = build_grids(x[:, own], scene.owner[own], scene.cell, len(scene.bodies), inward_normals(scene, x)[:, own])
    weights = volume[own]
    if scheme.moment_fitting:
        weights, grid = _fitted(scene, grid, weights, x)
    modulus = _ghost_moduli(scene, scheme, grid)
    return Derived(
        assembly=prepare(grid, weights, scene.masses[own], modulus),
        ghost=modulus,
        moment_fitting=scheme.moment_fitting,
        supports=_supports(scene, grid),
        supporting=scene.supporting,
    )


def torn_bodies(scene: Scene, grid: BodyGrids) -> Ints:
    """Bodies with an outline, which bounds one piece, whose cells form several: nothing connects their parts."""
    return np.flatnonzero(scene.outlined & (grid.pieces > 1))


def check_connected(scene: Scene, state: State) -> None:
    """Raise StepRejected if the cells of a body form several components."""
    grid = state.grids.assembly.grid
    torn = torn_bodies(scene, grid)
    if torn.size:
        raise StepRejected(
            f"body {torn[0]}",
            f"its cells form {grid.pieces[torn[0]]} pieces that share no node",
            "use a smaller spacing of its points or a larger cell",
            retryable=False,
        )


def _fitted(scene: Scene, grid: BodyGrids, volume: Array, x: Array) -> tuple[Array, BodyGrids]:
    """Quadrature weights (n,) of the points by moment fitting, and the grids with the places where strains are taken.

    Bodies without outline keep their volumes and places.
    """
    boundary = scene.outlines
    bounded = scene.outlined[grid.cell_body][grid.cell_of_point]
    if not bounded.any():
        return volume, grid
    moments = outline.cell_moments(boundary, x[:, boundary.point], scene.cell, grid.cell_index, grid.cell_body)[:3]
    weights = np.where(bounded, fitted_weights(grid, volume, moments), volume)
    places = np.where(bounded, fitted_places(grid, weights, moments), grid.local)
    return weights, replace(grid, quadrature=places)


def _supports(scene: Scene, grid: BodyGrids) -> Elimination | None:
    """Elimination of the constraints N(c) v = prescribed velocity, for each prescribed component at every point c."""
    if not scene.supports:
        return None
    number = np.cumsum(scene.deformable[scene.owner]) - 1
    rows, columns = [], []
    for i, (free, supported) in enumerate(zip(scene.free_components, scene.supported, strict=True)):
        at = grid.interpolation[number[supported.points]]
        for axis in np.flatnonzero(~free).tolist():
            rows.append(sp.kron(at, np.eye(2)[axis : axis + 1], format="csr"))
            columns.append(np.full(supported.points.size, 2 * i + axis))
    column = np.concatenate(columns)
    B = sp.csr_array(
        (np.ones(column.size), column, np.arange(column.size + 1)), shape=(column.size, 2 * len(scene.supports))
    )
    return eliminate(sp.csr_array(sp.vstack(rows)), B, grid.blocks, grid.rigid_motions)


def _ghost_moduli(scene: Scene, scheme: Scheme, grid: BodyGrids) -> Array:
    """Moduli of the ghost penalties of the cells, (cells,) [Pa]: of the softest material in each."""
    modulus = scene.first_moduli[grid.cell_body]
    if scene.composite.any():
        modulus[scene.composite[grid.cell_body]] = np.inf
        for material, points in scene.points_by_material:
            cells = grid.cell_of_point[points]
            modulus[cells] = np.minimum(modulus[cells], bounded_modulus(material))
    return np.asarray(scheme.ghost * modulus)


def _reference_is_outdated(state: State, scheme: Scheme) -> bool:
    """Whether deformation from the reference configuration exceeds `scheme.anchor`; true after t = 0 if that is 0."""
    if not np.isfinite(scheme.anchor) or state.t == 0.0:
        return False
    if scheme.anchor == 0.0:
        return True
    relative = product(state.F, inverse(state.F_anchor)) - np.eye(2)[:, :, None]
    return float(np.abs(relative).max(initial=0.0)) > scheme.anchor


def inward_normals(scene: Scene, x: Array) -> Array:
    """Inward normals of the boundary points, zero elsewhere, (2, n)."""
    inward = np.zeros_like(x)
    boundary = scene.outlines
    if boundary.point.size:
        inward[:, boundary.point] = -outline.normals(boundary, x[:, boundary.point])
    return inward


def check_parts_apart(scene: Scene, state: State, scheme: Scheme) -> None:
    """Raise StepRejected if regridding has joined parts of a body that approach each other: they would stick."""
    if np.isinf(scheme.anchor) or not scene.folded(state.x).size or acts_at_grid_nodes(scheme.contact):
        return
    joined = joined_parts(scene, state)
    if joined.size:
        raise StepRejected(
            f"body {joined[0]}",
            f"parts of it that approach each other share nodes of its grid, rebuilt by anchor = {scheme.anchor:g}",
            "use a larger Scheme.anchor, or inf",
            retryable=False,
        )


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
