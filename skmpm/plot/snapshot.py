"""What is drawn, of a state or of a frame of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.arrays import Array, Bools, Ints
from skmpm.io import Frame
from skmpm.observe import force_lines, network
from skmpm.outline import Polylines
from skmpm.outline.polylines import joined
from skmpm.scene import Scene, State, into_box, mises, plastic_strain, stress_zz

PARTS = 6  # lines between two boundary points: at 300 dpi a disc of 30 of them is round


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Bodies, walls and forces at one time; what costs is computed when it is drawn.

    Fields are "pressure", "mises", "displacement", "speed" and "plastic strain", (n,), nan if unknown; "volume", the
    areas of the points (n,) [m2]; and "stress", the elastic Cauchy stress, its components in the plane first,
    (2, 2, n) or (3, 3, n) [Pa].
    """

    t: float  # [s]
    x: Array  # (2, n) material points [m]
    owner: Ints  # (n,) their bodies
    deformable: Bools  # (bodies,)
    boundary_points: Ints  # (m,) material points on the outlines, loop after loop
    held: Ints  # (h,) material points whose velocity supports prescribe
    walls: Array  # (w, 2) a point of each [m]
    wall_normals: Array  # (w, 2)
    box: Array | None  # (2, 2) edges of the periodic box [m]; the bodies have their centres in it
    fields: Mapping[str, Callable[[], Array]]  # by name
    cell: Callable[[], float]  # size of cells that have some points each [m]
    boundary: Callable[[], Polylines]  # the smooth boundaries, through the boundary points
    forces: Callable[[], tuple[Array, Array]]  # lines (k, 2, 2) [m] of contacts, normal forces (k,) [N/m] along them

    @property
    def outlined(self) -> Bools:
        """Whether bodies have an outline, (bodies,)."""
        return np.bincount(self.owner[self.boundary_points], minlength=self.deformable.size) > 0

    @property
    def inside_deformable(self) -> Bools:
        """Whether material points belong to deformable bodies, (n,)."""
        return self.deformable[self.owner]


def of_state(scene: Scene, state: State) -> Snapshot:
    """What is drawn of a state that belongs to the scene: the curves on which contact acts, the contact network."""
    place, shift = scene.outlines.point, into_box(state.centres, state.box)
    x = state.x + shift[:, state.body]

    def forces() -> tuple[Array, Array]:
        pairs = network(scene, state)
        return force_lines(scene, state, pairs), pairs.force[0]

    return Snapshot(
        t=state.t,
        x=x,
        owner=scene.owner,
        deformable=scene.deformable,
        boundary_points=place,
        held=scene.held_points,
        walls=state.walls,
        wall_normals=state.wall_normals,
        box=state.box,
        fields={
            "pressure": lambda: np.asarray(-0.5 * (state.stress[0, 0] + state.stress[1, 1])),
            "mises": lambda: mises(state.stress, stress_zz(scene, state)),
            "displacement": lambda: np.asarray(np.hypot(*(state.x - scene.initial_positions))),
            "speed": lambda: np.asarray(np.hypot(*state.v)),
            "plastic strain": lambda: (
                plastic_strain(scene, state.internal) if state.internal.size else np.full(scene.owner.size, np.nan)
            ),
            "stress": lambda: state.stress,
            "volume": lambda: state.volume,
        },
        cell=lambda: scene.cell,
        boundary=lambda: outline.polylines(scene.outlines, scene.initial_positions[:, place], x[:, place], PARTS),
        forces=forces,
    )


def of_frame(frame: Frame) -> Snapshot:
    """What is drawn of a frame of a recording.

    Cells are as wide as one and a third points, which is usual; recordings do not have that of the scene.
    """
    recorded, loops, place = frame.points, frame.outlines, frame.boundary_points
    parts = sum(loop.shape[1] for loop in loops) // max(place.size, 1)

    def double(values: NDArray[Any]) -> Array:
        return np.asarray(values, dtype=np.float64)

    def stress() -> Array:
        return double(recorded["stress"])

    return Snapshot(
        t=frame.t,
        x=frame.x,
        owner=recorded["body"],
        deformable=frame.deformable,
        boundary_points=place,
        held=frame.held_points,
        walls=frame.walls["point"].T,
        wall_normals=frame.walls["normal"].T,
        box=frame.box,
        fields={
            "pressure": lambda: double(recorded["pressure"]),
            "mises": lambda: mises(stress(), stress()[2, 2]),
            "displacement": lambda: double(np.hypot(*recorded["displacement"])),
            "speed": lambda: double(np.hypot(*recorded["velocity"])),
            "plastic strain": lambda: double(recorded.get("plastic_strain", np.full(frame.x.shape[1], np.nan))),
            "stress": stress,
            "volume": lambda: double(recorded["volume"]),
        },
        cell=lambda: float(4.0 / 3.0 * np.sqrt(np.median(double(recorded["volume"])))),
        boundary=lambda: joined(loops, frame.bodies["body"], parts),
        forces=lambda: (frame.contacts["lines"], frame.contacts["normal_force"]),
    )
