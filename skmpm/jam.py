"""`jam`: a packing in a periodic box at its jamming point, or under a pressure, by static steps."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Bools
from skmpm.moduli import check_packing, strained
from skmpm.observe import Observables, observe
from skmpm.representation import line, quantity
from skmpm.scene import Scene, SceneError, State, StepFailed, at_rest
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial
from skmpm.step.scene_forces import has_gravity
from skmpm.values import number, positive

_log = logging.getLogger("skmpm")

STATIC = Scheme(inertia=False)
# Pressure over the largest bounded modulus of the bodies above which a packing is jammed. Without a network of forces
# it is below 1e-12 of it; a thousandth of solid fraction above jamming it is 1e-4.
JAMMED = 1e-8
CLOSE = 1e-3  # deviation from a given pressure, over it, that suffices
DENSEST = 1.2  # nominal solid fraction at which the search ends: discs fill the plane at less
COLUMNS = ("solid_fraction_nominal", "pressure", "coordination", "unbalanced")  # of the table of packings
SHORTER = 6  # times that a change of the solid fraction is halved where a static step fails


@dataclass(frozen=True, eq=False, repr=False)
class Jam:
    """A packing at rest at its jamming point, or under a pressure; `jam` defines it.

    Attributes
    ----------
    scene : the scene with a box that stays, with which the state goes on, as in ``moduli(found.scene, found.state)``
    state : the packing at rest; at the jamming point the loosest one found that is jammed
    solid_fraction : areas inside the smooth outlines over the box
    solid_fraction_nominal : initial areas over the box, by which is searched
    bracket : (2,) nominal solid fractions of the packings found just below and just above what was asked for
    pressure : mean pressure of the packing [Pa]
    coordination : mean number of neighbours, without rattlers; nan if all are rattlers
    rattlers : (bodies,) whether contacts do not hold a body at rest
    path : the packings at rest in the order in which they were found, columns solid_fraction_nominal, pressure [Pa],
        coordination and unbalanced, the largest resultant on a body over the mean contact force

    Examples
    --------
    >>> import skmpm
    >>> gel = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> body = skmpm.Body(skmpm.disc((1e-3, 1e-3), 1e-3, spacing=1.5e-4), gel)
    >>> scene = skmpm.Scene([body], cell=2e-4, periodic=skmpm.Periodic(2.01e-3, 2.01e-3))
    >>> found = skmpm.jam(scene, pressure=1e3)
    >>> bool(found.rattlers.any()), found.path["pressure"].size == found.path["coordination"].size
    (False, True)
    """

    scene: Scene
    state: State
    solid_fraction: float
    solid_fraction_nominal: float
    bracket: tuple[float, float]
    pressure: float
    coordination: float
    rattlers: Bools
    path: Mapping[str, Array]

    def __repr__(self) -> str:
        facts = {
            "solid fraction": f"{self.solid_fraction_nominal:.6g}",
            "pressure": quantity(self.pressure, "Pa"),
            "coordination": f"{self.coordination:.4g}",
            "rattlers": int(self.rattlers.sum()),
            "unbalanced": f"{self.state.report.unbalanced:.2g}",
        }
        return line("Jam", facts)


def jam(
    scene: Scene,
    state: State | None = None,
    *,
    pressure: float | None = None,
    increment: float = 1e-3,
    tolerance: float = 1e-6,
) -> Jam:
    """Bring a packing in a periodic box to its jamming point, or under a pressure, and to rest.

    Parameters
    ----------
    scene : a packing in a `Periodic` box, whose rate and stress do not matter; with friction, what is found depends
        on the way there
    state : state with which the search begins; by default that at t = 0
    pressure : mean pressure of the contact forces that the packing is to bear [Pa]; None for the jamming point
    increment : change of the nominal solid fraction at first
    tolerance : largest error of the nominal solid fraction, at most the increment. Under a pressure a deviation of
        1e-3 of it suffices, too

    Returns
    -------
    the packing with its solid fraction, coordination and pressure, and the way there; the time of its state is later
    by a second for each static step, which means nothing

    Raises
    ------
    SceneError
        if the scene has no box that is periodic in both directions, other forces than those of repulsive contact, or
        something that moves, the state belongs to another scene, a number is wrong, or no packing up to a nominal
        solid fraction of 1.2 bears the pressure
    StepFailed
        if there is no equilibrium nearby, though the change of solid fraction was halved six times

    Notes
    -----
    The box is compressed by increments of solid fraction, each followed by static equilibrium, until the packing
    bears the pressure (at the jamming point 1e-8 of the largest modulus), or released if it bears more at first. Then
    the interval between the last two packings is halved, always from the one that bears less, until it is below the
    tolerance. If that one, compressed to the other end, does not bear the pressure, as where grains have rearranged,
    the search goes on from there. By this protocol jamming points of soft particles are found by energy minimisation
    (O'Hern, Silbert, Liu & Nagel, Phys. Rev. E 68 (2003) 011306, and the bisection of JaxDEM): solid fractions
    compare one to one. Each packing at rest is logged at level INFO.

    Examples
    --------
    >>> import skmpm
    >>> gel = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> body = skmpm.Body(skmpm.disc((1e-3, 1e-3), 1e-3, spacing=1.5e-4), gel)
    >>> scene = skmpm.Scene([body], cell=2e-4, periodic=skmpm.Periodic(2.01e-3, 2.01e-3))
    >>> found = skmpm.jam(scene, tolerance=1e-4)
    >>> round(found.solid_fraction_nominal, 3), found.coordination  # pi / 4, as it touches its images
    (0.785, 4.0)
    """
    number("jam: increment", increment, "give a number between 1e-6 and 0.05", 1e-6, 0.05)
    number("jam: tolerance", tolerance, "give a number between 1e-9 and the increment", 1e-9, increment)
    if pressure is not None:
        positive("jam: pressure", pressure, "a pressure in Pa, or None for the jamming point")
    start = initial(scene, scheme=STATIC) if state is None else state
    check_packing("jam", scene, start)
    _check_contact_alone(scene)
    search = _Search(strained(scene, np.zeros((2, 2))), pressure)
    less = more = search.at_rest(start)
    while less.pressure >= search.wanted:
        less, more = search.further(less, -increment), less
    follows = less is more  # whether `more` is `less`, compressed: the same solid fraction may be reached otherwise
    if follows:
        less, more = search.compressed(less, increment)
    while not search.close(more) and (more.fraction - less.fraction > tolerance or not follows):
        wide = more.fraction - less.fraction > tolerance
        found = search.further(less, (0.5 if wide else 1.0) * (more.fraction - less.fraction))
        if found.pressure >= search.wanted:
            more, follows = found, True
        elif wide:
            less, follows = found, False
        else:
            (less, more), follows = search.compressed(found, increment), True
    seen = more.seen
    return Jam(
        search.still,
        more.state,
        seen.solid_fraction,
        more.fraction,
        (less.fraction, more.fraction),
        more.pressure,
        seen.coordination_without_rattlers,
        np.isnan(seen.bodies.coordination_without_rattlers),
        dict(zip(COLUMNS, np.array(search.rows).T, strict=True)),
    )


def _check_contact_alone(scene: Scene) -> None:
    """Raise SceneError if other forces than those of repulsive contact act on bodies."""
    given = {
        "gravity": has_gravity(scene),
        "loads": bool(scene.loads),
        "springs": bool(scene.springs),
        "supports": bool(scene.supports),
        "cohesion": scene.cohesive,
    }
    found = [name for name, acts in given.items() if acts]
    if found:
        raise SceneError(
            f"jam: the scene has {found[0]}, and jamming is that of repulsive contact alone; leave it out, as by"
            " dataclasses.replace(scene, ...)"
        )


@dataclass(frozen=True)
class _Packing:
    """A packing at rest."""

    state: State
    seen: Observables

    @property
    def fraction(self) -> float:
        """The nominal solid fraction."""
        return self.seen.solid_fraction_nominal

    @property
    def pressure(self) -> float:
        """The mean pressure of the contact forces [Pa]."""
        return self.seen.pressure


class _Search:
    """The packings that a search has found."""

    def __init__(self, still: Scene, pressure: float | None) -> None:
        self.still = still
        self.pressure = pressure
        self.wanted = JAMMED * still.largest_modulus if pressure is None else pressure  # [Pa]
        self.rows: list[tuple[float, ...]] = []  # as `COLUMNS`

    def at_rest(self, state: State) -> _Packing:
        """The packing at rest in the box of a state."""
        return self._solved(self.still, at_rest(self.still, state))

    def further(self, packing: _Packing, change: float) -> _Packing:
        """The packing at rest at another nominal solid fraction, in several steps where one fails."""
        left, length = change, change
        while left:
            length = length if abs(length) < abs(left) else left
            growth = np.log(1.0 + length / packing.fraction)
            if packing.fraction + length > DENSEST:
                raise SceneError(
                    f"jam: the packing bears {packing.pressure:.3g} Pa at a nominal solid fraction of"
                    f" {packing.fraction:.4g}, where the search ends; give a pressure below that"
                )
            try:
                packing = self._solved(strained(self.still, -0.5 * growth * np.eye(2)), packing.state)
            except StepFailed as error:
                length *= 0.5
                if abs(length) < abs(change) * 0.5**SHORTER:
                    raise StepFailed(
                        f"jam: no equilibrium was found near a solid fraction of {packing.fraction:.6g}"
                        f" ({error.problem})",
                        error.state,
                        remedy="begin with another state, or give a smaller increment",
                        retryable=False,
                    ) from error
                continue
            left -= length
        return packing

    def compressed(self, packing: _Packing, increment: float) -> tuple[_Packing, _Packing]:
        """The last packing that bears less than what is wanted, and the first that bears it."""
        less = more = packing
        while more.pressure < self.wanted:
            less, more = more, self.further(more, increment)
        return less, more

    def close(self, packing: _Packing) -> bool:
        """Whether the pressure is near enough to a given one."""
        return self.pressure is not None and packing.pressure < (1.0 + CLOSE) * self.pressure

    def _solved(self, scene: Scene, state: State) -> _Packing:
        """The packing after a static step, with a row of the table."""
        after = step(scene, state, 1.0, scheme=STATIC)
        seen = observe(scene, after)
        fraction, pressure, Z = seen.solid_fraction_nominal, seen.pressure, seen.coordination_without_rattlers
        self.rows.append((fraction, pressure, Z, after.report.unbalanced))
        said = "jam: at rest at a nominal solid fraction of %.6g, pressure %s, coordination %.3g without rattlers"
        _log.info(said, fraction, quantity(pressure, "Pa"), Z)
        return _Packing(after, seen)
