"""`observe`: the observables of a packing, as one frozen dataclass."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from skmpm import outline
from skmpm.arrays import Array
from skmpm.observe.bodies import PerBody, diameters, per_body
from skmpm.observe.contact_network import half_branches, moments
from skmpm.observe.regions import Region, area_inside, between_walls, contains, share_inside
from skmpm.optional import optional
from skmpm.representation import line, quantity, table
from skmpm.scene import Scene, State, check_fits

MARGIN = 2.0  # mean diameters between the walls and the interior


@dataclass(frozen=True, eq=False, repr=False)
class Observables:
    """The observables of a packing; `observe` defines them. Stress: tension positive.

    Attributes
    ----------
    solid_fraction : areas inside the smooth outlines / box
    solid_fraction_nominal : initial volumes / box
    coordination : Z, mean number of bodies and walls that touch a body
    coordination_without_rattlers : Z of the bodies that contacts can hold
    contact_surface : S, share of the perimeters in contact
    anisotropy : A_m, of the directions of long axes
    aspect_ratio : mean of long over short extents
    overlap : area shared by two bodies / area of all outlines
    pressure : pressure_contacts [Pa]
    pressure_contacts : -tr/2 of the stress of the contact forces [Pa]
    pressure_points : mean over the material points, with inertia the kinetic part included [Pa]; of elastic stress
        alone, without what viscosity adds to that of contacts
    pressure_walls : mean of wall_pressure over the walls that bound the box [Pa]
    stress : (2, 2) mean stress of the contact forces [Pa]
    wall_pressure : (walls,) normal force / length in the box [Pa]; nan where that is not finite or zero
    bodies : measurements of each body, `PerBody`

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> walls = [skmpm.Wall((0, -1e-3), (0, 1)), skmpm.Wall((0, 1e-3), (0, -1)), skmpm.Wall((-1e-3, 0), (1, 0)),
    ...          skmpm.Wall((1e-3, 0), (-1, 0))]
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=walls)
    >>> result = skmpm.observe(scene, skmpm.initial(scene))
    >>> round(float(result.solid_fraction), 1), round(float(result.coordination), 1)
    (0.8, 4.0)
    >>> result.bodies.aspect_ratio.round(2).tolist()
    [1.0]
    """

    solid_fraction: float
    solid_fraction_nominal: float
    coordination: float
    coordination_without_rattlers: float
    contact_surface: float
    anisotropy: float
    aspect_ratio: float
    overlap: float
    pressure: float
    pressure_contacts: float
    pressure_points: float
    pressure_walls: float
    stress: Array
    wall_pressure: Array
    bodies: PerBody

    def table(self) -> dict[str, float]:
        """The observables that are numbers, and the components of the stress: one row of a table over time."""
        row = {f.name: getattr(self, f.name) for f in fields(self)}
        row |= {f"stress_{a}{b}": float(self.stress[i, j]) for i, a in enumerate("xy") for j, b in enumerate("xy")}
        return {name: value for name, value in row.items() if isinstance(value, float)}

    def __repr__(self) -> str:
        numbers = {
            "solid fraction": self.solid_fraction,
            "coordination": self.coordination,
            "without rattlers": self.coordination_without_rattlers,
            "contact surface": self.contact_surface,
            "anisotropy": self.anisotropy,
            "aspect ratio": self.aspect_ratio,
            "overlap": self.overlap,
        }
        facts = {name: f"{value:.3g}" for name, value in numbers.items()}
        return line("Observables", facts | {"pressure": quantity(self.pressure, "Pa")})

    def _repr_html_(self) -> str:
        return table("Observables", {name: f"{value:.4g}" for name, value in self.table().items()})

    def to_pandas(self) -> Any:
        """The table as a `pandas.Series`; ImportError if pandas is not installed."""
        return optional("pandas", "to_pandas", "tables").Series(self.table())


def observe(scene: Scene, state: State, *, interior: bool = False) -> Observables:
    """Compute the observables of a packing.

    The box is the intersection of the walls, the periodic box, or one period between walls. If it is not closed, the
    solid fractions, the stress and the pressures (except those of each body) are nan. In a periodic box branches lead
    to the images that are touched, and velocities are relative to the motion of the box; without walls `interior`
    changes nothing. Grains are the bodies that forces move in all components, deformable and free rigid ones.
    Observables that need outlines are nan if a grain has none.

    Parameters
    ----------
    scene, state : a scene and its state
    interior : take means over bodies away from the walls only

    Returns
    -------
    the observables

    Notes
    -----
    - solid fractions: area inside the smooth outlines (`outline.curve`; nominal: initial volumes) over the
      area of the box; only the part of rigid bodies in the box counts.
    - coordination Z: mean number of bodies and walls that touch a grain; if no contact carries a force, those with a
      gap below 0.02 cells count as touching.
    - coordination_without_rattlers: the same without bodies that have fewer than three neighbours, or fewer than two
      with friction; several contacts with one neighbour count once. These are removed one after the other (O'Hern,
      Silbert, Liu & Nagel, Phys. Rev. E 68, 2003).
    - contact_surface: S = sum S_b / sum pi D_b over the grains, S_b the boundary length with a gap
      below 0.02 cells or between forced contacts, D_b the diameter of the disc of the initial area; nan for
      contacts at shared grid nodes, which have no length.
    - anisotropy: A_m = 2 (G1 - G2), G the mean of (cos, sin) (x) (cos, sin) of the long axes of the
      grains, I/2 for a round one. aspect_ratio: mean of their long over short extents.
    - stress: -sum f (x) branch / V over the contacts (Love-Weber), branches from centre to centre, for walls
      and bodies of prescribed motion from the contact point; without inertia. Of round bodies that nothing but
      frictionless contact acts on, it is the symmetric part: the mean Cauchy stress. pressure (= pressure_contacts)
      is its -tr/2.
    - pressure_points: -tr/2 of [sum w sigma - sum m v' (x) v'] / V over the points of deformable bodies, w their
      weights, v' the velocity relative to their mean; without v' after a quasi-static step. sigma is `State.stress`,
      without the viscous stress of materials, which pressure_contacts and pressure_walls contain.

    With `interior` means are taken over bodies whose centre lies at least two mean diameters from every wall
    (nan if there are none) and sums per volume over the box reduced by the same distance: outlines clipped to it
    exactly, the points in it, branches (through the contact point) by the share of their length in it. The
    pressure on walls is then nan. Source of S, A_m and alpha: Nezamabadi et al., Procedia Eng. 175 (2017) 141-147,
    doi:10.1016/j.proeng.2017.01.044.

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> plates = [skmpm.Wall((0, -1e-3), (0, 1)), skmpm.Wall((0, 1e-3), (0, -1), velocity=(0, -0.1))]
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=plates)
    >>> *_, state = skmpm.simulate(scene, dt=5e-4, until=1e-3, scheme=skmpm.Scheme(inertia=False))
    >>> result = skmpm.observe(scene, state)
    >>> round(result.coordination, 3)
    2.0
    >>> round(float(result.aspect_ratio), 1)
    1.1
    """
    check_fits(scene, state, "observe")
    box = between_walls(state, MARGIN * float(diameters(scene)[scene.grains].mean()) if interior else 0.0)
    own = scene.grains & contains(box, state.centres) if interior else scene.grains
    bodies = per_body(scene, state, own)
    solid, nominal = _fractions(scene, state, bodies, box, interior)
    stress = _stress(scene, state, bodies, box, interior)
    pressure = -float(np.trace(stress)) / 2.0
    walls = np.full(len(scene.walls), np.nan) if interior else _wall_pressure(scene, state, box)
    return Observables(
        solid_fraction=solid,
        solid_fraction_nominal=nominal,
        coordination=_mean(bodies.coordination[own]),
        coordination_without_rattlers=_mean(_finite(bodies.coordination_without_rattlers[own])),
        contact_surface=_mean(bodies.contact_surface[own], bodies.diameter[own]),
        anisotropy=_anisotropy(bodies.angle[own], bodies.aspect_ratio[own]),
        aspect_ratio=_mean(bodies.aspect_ratio[own]),
        overlap=_overlap(scene, bodies, interior),
        pressure=pressure,
        pressure_contacts=pressure,
        pressure_points=_pressure_points(scene, state, box, interior),
        pressure_walls=_mean(walls[box.length > 0.0]),
        stress=stress,
        wall_pressure=walls,
        bodies=bodies,
    )


def _fractions(scene: Scene, state: State, bodies: PerBody, box: Region, interior: bool) -> tuple[float, float]:
    """Solid fraction, of the outlines and of the initial volumes."""
    if not np.isfinite(box.area):
        return np.nan, np.nan
    initial = np.pi / 4.0 * bodies.diameter**2
    # The area of a rigid body is its volume, so it needs no outline.
    area = np.where(scene.deformable | np.isfinite(bodies.area), bodies.area, initial)
    share = np.ones(area.size)
    some = ~scene.deformable | interior
    if some.any():
        share[some] = _share(scene, state, bodies, box)[some]
    return float(area @ share) / box.area, float(initial @ share) / box.area


def _share(scene: Scene, state: State, bodies: PerBody, box: Region) -> Array:
    """Share of each body in the box, (bodies,): of its outline or, without one, of its points."""
    start = scene.offsets[:-1]
    points = np.add.reduceat(state.volume * contains(box, state.x), start) / np.add.reduceat(state.volume, start)
    boundary, x, n = scene.outlines, state.x[:, scene.outlines.point], len(scene.bodies)
    whole = np.where(np.isfinite(bodies.area), outline.area(boundary, x, n), 1.0)
    return np.where(np.isfinite(bodies.area), area_inside(box, boundary, x, n) / whole, points)


def _stress(scene: Scene, state: State, bodies: PerBody, box: Region, interior: bool) -> Array:
    """Stress of the contact forces in the box, (2, 2) [Pa]."""
    if not np.isfinite(box.area):
        return np.full((2, 2), np.nan)
    branches = half_branches(state.contacts, bodies.centre, scene.inside)
    weight = share_inside(box, branches.centre, branches.x) if interior else 1.0
    return np.asarray(moments(branches, weight, scene.free_to_turn).sum(axis=2) / box.area)


def _pressure_points(scene: Scene, state: State, box: Region, interior: bool) -> float:
    if not np.isfinite(box.area):
        return np.nan
    own = scene.deformable[state.body]
    if interior:
        own &= contains(box, state.x)
    mass = state.mass * own
    if not own.any():
        return 0.0
    relative = state.v if state.box_rate is None else state.v - state.box_rate @ state.x
    relative = relative - (relative @ mass / mass.sum())[:, None]
    virial = np.trace(state.stress) @ (state.weight * own)
    if state.report.inertia:
        virial -= (relative**2).sum(axis=0) @ mass
    return -float(virial) / box.area / 2.0


def _wall_pressure(scene: Scene, state: State, box: Region) -> Array:
    """Return normal force over length in the box of each wall, (walls,) [Pa]."""
    bounds = np.isfinite(box.length) & (box.length > 0.0)
    force = -np.einsum("iw,wi->w", scene.normals, state.wall_force)
    return np.where(bounds, force / np.where(bounds, box.length, 1.0), np.nan)


def _overlap(scene: Scene, bodies: PerBody, interior: bool) -> float:
    chosen = bodies.counted if interior else scene.grains | np.isfinite(bodies.area)
    # Half of a shared area belongs to each of the two bodies.
    return _mean(bodies.overlap[chosen], bodies.area[chosen]) / 2.0


def _anisotropy(angle: Array, aspect_ratio: Array) -> float:
    """A_m: the difference of the principal values of G is the length of the mean of (cos 2a, sin 2a)."""
    if angle.size == 0 or np.isnan(aspect_ratio).any():
        return np.nan
    double = 2.0 * angle[np.isfinite(angle)]
    return 2.0 * float(np.hypot(np.cos(double).sum(), np.sin(double).sum())) / angle.size


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]


def _mean(values: Array, weights: Array | None = None) -> float:
    """Mean; nan if there are no values."""
    return float(np.average(values, weights=weights)) if values.size else np.nan
