"""When body grids are built anew, and what is refused then.

They are built in a reference configuration, the anchor (`Scheme.anchor`): `State.x_anchor`, `F_anchor` and
`stress_anchor` are the positions, deformation gradients and stresses that the points had there. Regridding makes the
current configuration the reference configuration.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.self_contact import joined_parts
from skmpm.grid import BodyGrids
from skmpm.material import determinant, inverse, product
from skmpm.scene import Derived, Scene, SceneError, State
from skmpm.scheme import Scheme
from skmpm.step.derived import derived_data, ghost_moduli
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
        and np.array_equal(kept.ghost, ghost_moduli(scene, scheme, kept.assembly.grid))
    )


def _at_anchor(scene: Scene, state: State, scheme: Scheme) -> Derived:
    return derived_data(scene, scheme, state.x_anchor, scene.initial_volumes * determinant(state.F_anchor))


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


def _reference_is_outdated(state: State, scheme: Scheme) -> bool:
    """Whether deformation from the reference configuration exceeds `scheme.anchor`; true after t = 0 if that is 0."""
    if not np.isfinite(scheme.anchor) or state.t == 0.0:
        return False
    if scheme.anchor == 0.0:
        return True
    relative = product(state.F, inverse(state.F_anchor)) - np.eye(2)[:, :, None]
    return float(np.abs(relative).max(initial=0.0)) > scheme.anchor


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
