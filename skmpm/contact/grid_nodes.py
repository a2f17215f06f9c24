"""Shared-grid contact, at grid nodes that belong to several bodies.

The method of Nezamabadi et al., Procedia Eng. 175 (2017) 141-147, doi:10.1016/j.proeng.2017.01.044. At a node shared
by two bodies the normal follows from the gradients of their masses (Huang et al., IJNME 2011), and Signorini's law
acts on the relative velocity, independently of the gap: bodies stop about one cell apart. Provided to reproduce the
published results and as the reference for point-to-curve contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array, Ints
from skmpm.contact.constraints import Constraints, Linearise, SurfaceGeometry
from skmpm.contact.rows import joined
from skmpm.grid import BodyGrids, build_grids
from skmpm.scene import PrescribedVelocities, Scene, SceneError, State, prescribed_velocities


@dataclass(frozen=True)
class _Nodes:
    """Nodes of body grids, with the data needed for contact at shared nodes."""

    index: Ints  # (2, nodes) integer coordinates
    body: Ints  # (nodes,) walls are -1, -2, ...
    outward: Array  # (2, nodes) sum of m_p grad N(x_p) [kg/m2]
    unknown: Ints  # (nodes,) number among the unknown nodes, -1 where the motion is prescribed
    prescribed: Array  # (2, nodes) [m/s]


def shared_grid(
    scene: Scene,
    state: State,
    grid: BodyGrids,
    dt: float,
    theta: float = 1.0,
    motions: PrescribedVelocities | None = None,
    inertia: bool = True,
) -> Linearise:
    """Contact at grid nodes that bodies share; walls are slabs of rigid material points.

    Parameters
    ----------
    scene, state, grid : a scene, its state, and the body grids
    dt : length of the step [s]
    theta, inertia : ignored
    motions : prescribed velocities of the step; None: evaluated here

    Returns
    -------
    function that returns the `Constraints`, the same for all nodal velocities

    Raises
    ------
    SceneError
        if the body grids are not rebuilt at every step

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1.2e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(contact=skmpm.contact.shared_grid, anchor=0.0)
    >>> state = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), 1e-4, scheme=scheme)
    >>> bool(state.wall_force[0, 1] < 0)  # half a cell away
    True
    """
    unknown = scene.deformable[state.body]
    if not np.array_equal(state.x_anchor, state.x):
        raise SceneError(
            "shared_grid needs body grids rebuilt at every step; use Scheme(anchor=0) or Scheme.nezamabadi2017()"
        )
    motions = prescribed_velocities(scene, state.t, dt) if motions is None else motions
    nodes = joined(
        [
            _deformable(grid, state.mass[unknown]),
            _rigid(scene, state, grid.cell, motions.rigid),
            _walls(scene, state, grid.cell, motions.walls.T),
        ]
    )
    constraints = _constraints(scene, nodes, *_pairs(nodes), grid)
    return lambda w: constraints


shared_grid.at_grid_nodes = True  # type: ignore[attr-defined]  # and not between outlines, see `acts_at_grid_nodes`


def _deformable(grid: BodyGrids, mass: Array) -> _Nodes:
    outward = np.stack([D.T @ mass for D in grid.derivatives])
    return _Nodes(grid.node_index, grid.node_body, outward, np.arange(grid.nodes), np.zeros((2, grid.nodes)))


def _prescribed(x: Array, body: Ints, mass: Array, velocity: Array, cell: float) -> _Nodes:
    """Nodes of rigid bodies, numbered from 0, that move with `velocity` (2, bodies) [m/s]."""
    grid = build_grids(x, body, cell, velocity.shape[1])
    nodes = _deformable(grid, mass)
    return _Nodes(nodes.index, nodes.body, nodes.outward, np.full(grid.nodes, -1), velocity[:, grid.node_body])


def _rigid(scene: Scene, state: State, cell: float, motions: Array) -> _Nodes:
    """Nodes of rigid bodies that move as `motions` (3, bodies)."""
    chosen = ~scene.deformable[state.body]
    nodes = _prescribed(state.x[:, chosen], state.body[chosen], state.mass[chosen], motions[:2], cell)
    spin = motions[2, nodes.body]
    if not spin.any():
        return nodes
    arm = cell * nodes.index - state.centres[:, nodes.body]
    return replace(nodes, prescribed=nodes.prescribed + spin * np.stack([-arm[1], arm[0]]))


def _walls(scene: Scene, state: State, cell: float, velocity: Array) -> _Nodes:
    """Nodes of walls: slabs of rigid material points, four per cell, that exceed the bodies by three cells.

    They are two cells thick: points in front of a wall share nodes less than one cell behind its surface with it, and
    these nodes receive mass from points less than two cells deep.
    """
    spacing, layers = 0.5 * cell, 4
    parts, owner = [], []
    for i, normal in enumerate(scene.normals.T):
        tangent = np.array([-normal[1], normal[0]])
        reach = tangent @ (state.x - state.walls[i][:, None])
        along = np.arange(reach.min() - 3.0 * cell, reach.max() + 3.0 * cell, spacing)
        depth = -spacing * (np.arange(layers) + 0.5)
        points = state.walls[i][:, None, None] + tangent[:, None, None] * along[:, None]
        points = points + normal[:, None, None] * depth
        parts.append(points.reshape(2, -1))
        owner.append(np.full(parts[-1].shape[1], i))
    if not parts:
        return _prescribed(np.zeros((2, 0)), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((2, 1)), cell)
    x, body = np.concatenate(parts, axis=1), np.concatenate(owner)
    density = float(state.mass.sum() / state.volume.sum())
    mass = np.full(body.size, density * spacing**2)
    nodes = _prescribed(x, body, mass, velocity, cell)
    return _Nodes(nodes.index, -1 - nodes.body, nodes.outward, nodes.unknown, nodes.prescribed)


def _pairs(nodes: _Nodes) -> tuple[Ints, Ints]:
    """All pairs of bodies at every node that two or more share; at least one of each pair has unknowns."""
    low = nodes.index.min(axis=1)
    relative = nodes.index - low[:, None]
    position = relative[0] * (relative[1].max() + 1) + relative[1]
    # At each node bodies come first, in the order of their numbers, then walls.
    order = np.lexsort((np.abs(nodes.body), nodes.body < 0, position))
    first, second = [], []
    step = 1
    while True:
        same = position[order[step:]] == position[order[:-step]]
        if not same.any():
            break
        first.append(order[:-step][same])
        second.append(order[step:][same])
        step += 1
    a = np.concatenate(first) if first else np.zeros(0, dtype=np.int64)
    b = np.concatenate(second) if second else np.zeros(0, dtype=np.int64)
    free = (nodes.unknown[a] >= 0) | (nodes.unknown[b] >= 0)
    return a[free], b[free]


def _constraints(scene: Scene, nodes: _Nodes, a: Ints, b: Ints, grid: BodyGrids) -> Constraints:
    normal = nodes.outward[:, b] - nodes.outward[:, a]
    length = np.hypot(*normal)
    # The normal is undefined at a node that both bodies surround symmetrically.
    kept = length > 1e-9 * np.maximum(np.hypot(*nodes.outward[:, a]), np.hypot(*nodes.outward[:, b]))
    a, b, normal = a[kept], b[kept], normal[:, kept] / length[kept]
    k = np.arange(a.size)
    ends, sign = np.concatenate([nodes.unknown[a], nodes.unknown[b]]), np.repeat([1.0, -1.0], k.size)
    own = ends >= 0
    difference = sp.csr_array((sign[own], (np.tile(k, 2)[own], ends[own])), shape=(k.size, grid.nodes))
    prescribed = nodes.prescribed[:, a] - nodes.prescribed[:, b]
    bodies = np.stack([nodes.body[a], nodes.body[b]])
    return Constraints(
        bodies=bodies,
        x=grid.cell * nodes.index[:, a].astype(float),
        normal=normal,
        gap=np.zeros(k.size),
        friction=scene.frictions.between(bodies),
        key=_key(scene, nodes, a, b),
        point=np.full(k.size, -1),
        base=sp.eye_array(grid.nodes, format="csr"),
        difference=difference,
        geometry=SurfaceGeometry.fixed(difference.shape[0]),
        rigid=np.zeros((grid.nodes, 2)),
        surfaces=prescribed,
        offset_normal=np.einsum("ik,ik->k", normal, prescribed),
        pushed_out=np.zeros(k.size),
        tensile_strength=np.zeros(k.size),
        opening=np.zeros(k.size),
        image=np.zeros((2, k.size)),
    )


def _key(scene: Scene, nodes: _Nodes, a: Ints, b: Ints) -> Ints:
    """(node, body, body) as one integer, unique for nodes of as wide a window of cells as 62 bits allow."""
    members = len(scene.bodies) + len(scene.walls)
    number = np.where(nodes.body < 0, len(scene.bodies) - 1 - nodes.body, nodes.body)
    window = 2 ** (31 - members.bit_length())
    position = (nodes.index[0, a] % window) * window + nodes.index[1, a] % window
    return np.asarray((position * members + number[a]) * members + number[b])
