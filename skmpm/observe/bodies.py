"""Observables of each body."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.material import determinant
from skmpm.observe.contact_network import (
    half_branches,
    moments,
    sums,
    touching_pairs,
    without_rattlers,
)
from skmpm.observe.sides import contact_lengths
from skmpm.optional import data_frame
from skmpm.outline import Outlines
from skmpm.representation import with_shapes
from skmpm.scene import Scene, State


@dataclass(frozen=True, eq=False, repr=False)
class PerBody:
    """Observables of each body, whether or not it enters the means.

    Attributes
    ----------
    counted : (bodies,) enters the means: its motion is not prescribed and, with `interior`, it is in the interior
    centre : (2, bodies) centres of mass [m]
    diameter : (bodies,) diameter of the disc of the initial area [m]
    area : (bodies,) inside the smooth outline [m2]; nan without an outline
    perimeter : (bodies,) length of the smooth outline, holes included [m]; nan without an outline
    volume_ratio : (bodies,) J = sum w / sum (w / det F) with the quadrature weights w of the points
    coordination : (bodies,) bodies and walls that touch it
    coordination_without_rattlers : (bodies,) those that are no rattlers; nan for a rattler
    contact_surface : (bodies,) length in contact over pi diameter
    aspect_ratio : (bodies,) extents along the principal axes, long over short; 1 if round
    angle : (bodies,) direction of the long axis, in (-pi/2, pi/2] [rad]; nan for a round body
    overlap : (bodies,) area shared with other bodies / area
    stress : (2, 2, bodies) stress of the contact forces over the current volume [Pa], tension positive; see `observe`
    pressure : (bodies,) -tr/2 of it [Pa]
    pressure_points : (bodies,) pressure of the material points, with inertia that of their velocities relative to the
        centre included [Pa], without viscous stress, which `stress` and `pressure` contain; nan for rigid bodies
    """

    __repr__ = with_shapes

    counted: Bools
    centre: Array
    diameter: Array
    area: Array
    perimeter: Array
    volume_ratio: Array
    coordination: Array
    coordination_without_rattlers: Array
    contact_surface: Array
    aspect_ratio: Array
    angle: Array
    overlap: Array
    stress: Array
    pressure: Array
    pressure_points: Array

    @property
    def shape_factor(self) -> Array:
        """Perimeter^2 / (4 pi area), (bodies,), 1 for a disc; Boromand et al., Phys. Rev. Lett. 121 (2018) 248003."""
        return np.asarray(self.perimeter**2 / (4.0 * np.pi * self.area))

    @property
    def deviatoric_stress(self) -> Array:
        """Half the difference of the principal values of `stress`, (bodies,) [Pa]."""
        (xx, xy), (yx, yy) = self.stress
        return np.asarray(np.hypot(0.5 * (xx - yy), 0.5 * (xy + yx)))

    to_pandas = data_frame

    def table(self) -> dict[str, NDArray[np.generic]]:
        """Columns (bodies,) by name, as `pandas.DataFrame` takes them."""
        own: dict[str, NDArray[np.generic]] = {f.name: getattr(self, f.name) for f in fields(self)}
        del own["centre"], own["stress"]
        own |= {"x": self.centre[0], "y": self.centre[1]}
        own |= {f"stress_{a}{b}": self.stress[i, j] for i, a in enumerate("xy") for j, b in enumerate("xy")}
        return own | {"shape_factor": self.shape_factor, "deviatoric_stress": self.deviatoric_stress}


def diameters(scene: Scene) -> Array:
    """Diameters of the discs of the initial areas of bodies, (bodies,) [m]."""
    area = np.array([body.points.volume.sum() for body in scene.bodies])
    return np.asarray(2.0 * np.sqrt(area / np.pi))


def per_body(scene: Scene, state: State, counted: Bools) -> PerBody:
    """Compute the observables of each body, of which some are `counted` (bodies,)."""
    n, start, pairs = len(scene.bodies), scene.offsets[:-1], touching_pairs(state.contacts, scene.cell, state.box)
    boundary, x = scene.outlines, state.x[:, scene.outlines.point]
    volume = np.add.reduceat(state.volume, start)
    mass, centre, diameter = np.add.reduceat(state.mass, start), state.centres, diameters(scene)
    smooth = outline.curve(boundary, scene.initial_positions[:, boundary.point]).through(x)
    area = np.where(scene.outlined, smooth.area(n), np.nan)
    long, short, angle = outline.dimensions(boundary, x, n)
    isotropic = _isotropic(boundary, x, n)
    length = sums(state.contacts.bodies, contact_lengths(scene, state), n)
    stress = moments(half_branches(state.contacts, centre, np.ones(n, dtype=bool)), 1.0, scene.free_to_turn) / volume
    return PerBody(
        counted=counted,
        centre=centre,
        diameter=diameter,
        area=area,
        perimeter=np.where(scene.outlined, smooth.perimeter(n), np.nan),
        volume_ratio=np.add.reduceat(state.weight, start)
        / np.add.reduceat(state.weight / determinant(state.F), start),
        coordination=sums(pairs, 1.0, n),
        coordination_without_rattlers=without_rattlers(pairs, scene.frictions.between(pairs), scene.grains),
        contact_surface=np.where(scene.outlined, length, np.nan) / (np.pi * diameter),
        aspect_ratio=np.where(isotropic, 1.0, long / short),
        angle=np.where(isotropic, np.nan, angle),
        overlap=_shared(scene, state, x) / area,
        stress=stress,
        pressure=-np.trace(stress) / 2.0,
        pressure_points=np.where(scene.deformable, _pressure_points(state, start, volume, mass), np.nan),
    )


def _isotropic(boundary: Outlines, x: Array, bodies: int) -> Bools:
    """Whether bodies have no long axis, (bodies,)."""
    M = outline.second_moments(boundary, x, bodies)
    result: Bools = np.hypot(M[0, 0] - M[1, 1], 2.0 * M[0, 1]) <= ROUND_OFF * np.trace(M)
    return result


def _shared(scene: Scene, state: State, x: Array) -> Array:
    """Area that each body, with boundary points at x (2, m), shares with others, (bodies,) [m2]."""
    near = scene.images(x, state.box, 0.0)
    return sums(*near.overlap(near.at(x, state.box)), len(scene.bodies))


def _pressure_points(state: State, start: Ints, volume: Array, mass: Array) -> Array:
    v = np.add.reduceat(state.mass * state.v, start, axis=1) / mass
    relative = state.v - v[:, state.body]
    virial = state.weight * np.trace(state.stress)
    if state.report.inertia:
        virial = virial - state.mass * (relative**2).sum(axis=0)
    return -np.add.reduceat(virial, start) / volume / 2.0
