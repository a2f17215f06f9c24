"""What is recorded of a state, by blocks of the file: points, bodies, contacts and walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.io.vtkhdf import PolyData
from skmpm.material import determinant
from skmpm.observe import force_lines, network, observe
from skmpm.scene import Scene, State, centres, into_box, plastic_strain, stress_zz, view_of, wall_lines

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

PARTS = 4  # lines between two boundary points of a recorded outline
OF_CONTACTS = ("first", "second", "normal_force", "tangential_force", "mobilised_friction", "length")
OF_BODIES = ("pressure", "deviatoric_stress", "coordination", "volume_ratio", "aspect_ratio")


def blocks_of(scene: Scene, state: State) -> dict[str, PolyData]:
    """The blocks of a state by name."""
    shift = into_box(centres(state.x, state.mass, state.body), state.box)
    blocks = {
        "points": _points(scene, state, shift),
        "bodies": _bodies(scene, state, shift),
        "contacts": _contacts(scene, state, shift),
        "walls": _walls(state),
    }
    return blocks if state.box is None else blocks | {"box": _box(state.box)}


def _points(scene: Scene, state: State, shift: Array) -> PolyData:
    """One vertex per material point, displaced by the shift (2, bodies) [m] of its body into the periodic box."""
    sigma, zero = state.stress, np.zeros(state.x.shape[1])
    rows = [[sigma[0, 0], sigma[0, 1], zero], [sigma[1, 0], sigma[1, 1], zero], [zero, zero, stress_zz(scene, state)]]
    data = {
        "body": scene.owner,
        "velocity": _in_space(state.v),
        "displacement": _in_space(state.x - scene.initial_positions),
        "stress": np.stack([entry for row in rows for entry in row], axis=1),
        "pressure": -0.5 * (sigma[0, 0] + sigma[1, 1]),
        "volume": state.volume,
        "det_F": determinant(state.F),
    }
    if state.internal.size:
        data["plastic_strain"] = plastic_strain(scene, state.internal)
    return PolyData(
        _in_space(state.x + shift[:, state.body]), {"Vertices": np.arange(state.x.shape[1])[:, None]}, data
    )


def _bodies(scene: Scene, state: State, shift: Array) -> PolyData:
    """The smooth boundaries: a polygon per body, lines for those with holes, with data of the body."""
    place = scene.outlines.point
    x, reference = (state.x + shift[:, state.body])[:, place], scene.initial_positions[:, place]
    curve = outline.polylines(scene.outlines, reference, x, PARTS)
    owner = curve.outlines.body[curve.loops[:-1]]
    loops = [np.arange(*curve.loops[i : i + 2]) for i in range(owner.size)]
    single = np.bincount(owner, minlength=len(scene.bodies))[owner] == 1
    lines = [np.append(loop, loop[0]) for loop, one in zip(loops, single, strict=True) if not one]
    cells: dict[str, Sequence[Ints] | Ints] = {
        "Lines": lines,
        "Polygons": [loop for loop, one in zip(loops, single, strict=True) if one],
    }
    body = np.concatenate([owner[~single], owner[single]])
    seen = observe(scene, state).bodies
    start, mass = scene.offsets[:-1], np.add.reduceat(state.mass, scene.offsets[:-1])
    velocity = np.add.reduceat(state.mass * state.v, start, axis=1) / mass
    data = {"body": body, "velocity": _in_space(velocity[:, body])}
    return PolyData(_in_space(curve.x), cells, {}, data | {name: getattr(seen, name)[body] for name in OF_BODIES})


def _contacts(scene: Scene, state: State, shift: Array) -> PolyData:
    """A line for each pair of bodies that touch, between their centres, with its forces."""
    pairs = network(scene, state)
    ends = force_lines(scene, state, pairs) + shift[:, pairs.bodies[0]].T[:, None]
    number = np.arange(2 * pairs.size)
    table = pairs.table()
    data = {name: table[name] for name in OF_CONTACTS}
    return PolyData(_in_space(ends.reshape(-1, 2).T), {"Lines": number.reshape(-1, 2)}, {}, data)


def _walls(state: State) -> PolyData:
    """A line for each wall near the bodies."""
    lines, walls = wall_lines(state.walls, state.wall_normals, view_of(state.x, state.walls, state.wall_normals))
    point, normal = state.walls[walls].T, state.wall_normals[walls].T
    data = {"wall": -1 - walls, "point": _in_space(point), "normal": _in_space(normal)}
    cells = {"Lines": np.arange(2 * walls.size).reshape(-1, 2)}
    return PolyData(_in_space(lines.reshape(-1, 2).T), cells, {}, data)


def _box(box: Array) -> PolyData:
    """The periodic box as a closed line."""
    corners = np.stack([np.zeros(2), box[:, 0], box.sum(axis=1), box[:, 1]], axis=1)
    return PolyData(_in_space(corners), {"Lines": [np.array([0, 1, 2, 3, 0])]}, {}, {})


def _in_space(vectors: Array) -> Array:
    """Vectors (2, k) with a third component 0, (k, 3)."""
    return np.stack([*vectors, np.zeros(vectors.shape[1])], axis=1)
