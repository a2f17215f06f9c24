"""What is drawn, of a state or of a frame of a recording."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from skmpm import outline
from skmpm.arrays import Array, Bools, Ints
from skmpm.io import Frame
from skmpm.observe import force_lines, network
from skmpm.outline import Polylines
from skmpm.outline.polylines import joined
from skmpm.scene import Scene, State, centres, into_box, mises, plastic_strain, stress_zz

PARTS = 6  # lines between two boundary points: at 300 dpi a disc of 30 of them is round


@dataclass(frozen=True, eq=False)
class Snapshot(ABC):
    """Bodies, walls and forces at one time; what costs is computed when it is drawn."""

    t: float  # [s]
    x: Array  # (2, n) material points [m]
    owner: Ints  # (n,) their bodies
    deformable: Bools  # (bodies,)
    boundary_points: Ints  # (m,) material points on the outlines, loop after loop
    held: Ints  # (h,) material points whose velocity supports prescribe
    walls: Array  # (w, 2) a point of each [m]
    wall_normals: Array  # (w, 2)
    box: Array | None  # (2, 2) edges of the periodic box [m]; the bodies have their centres in it

    @property
    def outlined(self) -> Bools:
        """Whether bodies have an outline, (bodies,)."""
        return np.bincount(self.owner[self.boundary_points], minlength=self.deformable.size) > 0

    @property
    def inside_deformable(self) -> Bools:
        """Whether material points belong to deformable bodies, (n,)."""
        return self.deformable[self.owner]

    @property
    def unknown(self) -> Array:
        """No value at the material points, (n,)."""
        return np.full(self.owner.size, np.nan)

    @abstractmethod
    def boundary(self) -> Polylines:
        """The smooth boundaries, through the boundary points."""

    @abstractmethod
    def values(self, name: str) -> Array:
        """The field "pressure", "mises", "displacement", "speed" or "plastic strain", (n,); nan if unknown."""

    @property
    @abstractmethod
    def stress(self) -> Array:
        """Elastic Cauchy stress at the points, its components in the plane first, (2, 2, n) or (3, 3, n) [Pa]."""

    def deviator(self) -> Array:
        """(s_xx - s_yy, 2 s_xy), (2, n) [Pa]; its length is the difference of the principal stresses in the plane."""
        stress = self.stress
        return np.stack([stress[0, 0] - stress[1, 1], 2.0 * stress[0, 1]])

    @property
    @abstractmethod
    def volume(self) -> Array:
        """Areas of the points, (n,) [m2]."""

    @property
    @abstractmethod
    def cell(self) -> float:
        """Size of cells that have some points each [m]."""

    @abstractmethod
    def forces(self) -> tuple[Array, Array]:
        """Lines (k, 2, 2) [m] of the contact network and the normal forces (k,) [N/m] along them."""


@dataclass(frozen=True, eq=False)
class OfState(Snapshot):
    """What is drawn of a state."""

    scene: Scene
    state: State
    shift: Array  # (2, bodies) of the bodies into the periodic box [m]

    @classmethod
    def from_state(cls, scene: Scene, state: State) -> OfState:
        """The snapshot of a state that belongs to the scene."""
        place = [held.points for held in scene.supported]
        held = np.unique(np.concatenate(place)) if place else np.zeros(0, dtype=np.int64)
        bodies = scene.deformable, scene.outlines.point, held
        shift = into_box(centres(state.x, state.mass, state.body), state.box)
        x, walls = state.x + shift[:, state.body], (state.walls, state.wall_normals)
        return cls(state.t, x, scene.owner, *bodies, *walls, state.box, scene, state, shift)

    def boundary(self) -> Polylines:
        """The curves on which contact acts."""
        scene, place = self.scene, self.boundary_points
        return outline.polylines(scene.outlines, scene.initial_positions[:, place], self.x[:, place], PARTS)

    def values(self, name: str) -> Array:
        """A field of the state."""
        state = self.state
        if name == "displacement":
            return np.asarray(np.hypot(*(state.x - self.scene.initial_positions)))
        if name == "speed":
            return np.asarray(np.hypot(*state.v))
        if name == "mises":
            return mises(state.stress, stress_zz(self.scene, state))
        if name == "plastic strain":
            return plastic_strain(self.scene, state.internal) if state.internal.size else self.unknown
        return np.asarray(-0.5 * (state.stress[0, 0] + state.stress[1, 1]))

    @property
    def stress(self) -> Array:
        """That of the state."""
        return self.state.stress

    @property
    def volume(self) -> Array:
        """Those of the state."""
        return self.state.volume

    @property
    def cell(self) -> float:
        """That of the scene."""
        return self.scene.cell

    def forces(self) -> tuple[Array, Array]:
        """The contact network of the state."""
        pairs = network(self.scene, self.state)
        lines = force_lines(self.scene, self.state, pairs) + self.shift[:, pairs.bodies[0]].T[:, None]
        return lines, pairs.force[0]


@dataclass(frozen=True, eq=False)
class OfFrame(Snapshot):
    """What is drawn of a frame of a recording."""

    frame: Frame

    @classmethod
    def from_frame(cls, frame: Frame) -> OfFrame:
        """The snapshot of a frame."""
        bodies = frame.points["body"], frame.deformable, frame.boundary_points, frame.held_points
        return cls(frame.t, frame.x, *bodies, frame.walls["point"].T, frame.walls["normal"].T, frame.box, frame)

    def boundary(self) -> Polylines:
        """The recorded boundaries."""
        loops = self.frame.outlines
        parts = sum(loop.shape[1] for loop in loops) // max(self.boundary_points.size, 1)
        return joined(loops, self.frame.bodies["body"], parts)

    def values(self, name: str) -> Array:
        """A recorded field."""
        fields = self.frame.points
        if name in ("displacement", "speed"):
            return np.asarray(np.hypot(*fields["velocity" if name == "speed" else name]), dtype=np.float64)
        if name == "mises":
            stress = self.stress
            return mises(stress, stress[2, 2])
        if name == "plastic strain":
            return np.asarray(fields.get("plastic_strain", self.unknown), dtype=np.float64)
        return fields[name].astype(np.float64)

    @property
    def stress(self) -> Array:
        """The recorded one."""
        return self.frame.points["stress"].astype(np.float64)

    @property
    def volume(self) -> Array:
        """The recorded ones."""
        return self.frame.points["volume"].astype(np.float64)

    @property
    def cell(self) -> float:
        """As wide as one and a third points, which is usual; recordings do not have that of the scene."""
        return float(4.0 / 3.0 * np.sqrt(np.median(self.volume)))

    def forces(self) -> tuple[Array, Array]:
        """The recorded contact network."""
        return self.frame.contacts["lines"], self.frame.contacts["normal_force"]
