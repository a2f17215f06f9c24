"""The verified range: one table of limits and of choices that do not go together, and the warnings they make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10, nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Bools, Ints
from skmpm.contact.closest_points import LIGHT
from skmpm.scheme import NEARLY_INCOMPRESSIBLE
from skmpm.step.equations import LONG
from skmpm.step.step_length import MAX_APPROACH, STROKE

LIMIT_TOLERANCE = 1e-9  # relative excess over a limit that is round-off
DOWN, UP = floor, ceil


@dataclass(frozen=True)
class PreflightWarning:
    """Something outside of the verified range, or choices that do not go together; printed as a sentence.

    Attributes
    ----------
    kind : what is limited, as "R/h"; at most one warning of a kind is given
    object : what is concerned, as "body 3": the worst, where it is one of several
    count : number of objects that are concerned
    value, limit : of the worst object, and the end of the verified range; None where choices do not go together
    section : of docs/how_to/warnings.md, which explains it
    text : object, value, what was verified, remedy
    """

    kind: str
    object: str
    count: int
    value: float | None
    limit: float | None
    section: str
    text: str

    def __str__(self) -> str:
        return f"{self.text} [{self.section}]"


@dataclass(frozen=True)
class Limit:
    """A row of the table: what is limited, and the texts of its warning.

    In the texts {value} is that of the worst object, {size} that value times a scale, and {advised} the scale times
    what brings the value to the limit, with two digits and rounded so that it causes no warning.
    """

    kind: str
    section: str
    value: float  # end of the verified range; nan where choices do not go together
    says: str  # of the object
    where: str  # what was verified
    remedy: str
    least: bool = False  # whether the range begins here instead of ending
    rounded: Callable[[float], int] = DOWN

    def beyond(self, values: ArrayLike) -> Bools:
        """Whether values leave the range by more than round-off."""
        if self.least:
            return np.asarray(np.less(values, self.value * (1.0 - LIMIT_TOLERANCE)))
        return np.asarray(np.greater(values, self.value * (1.0 + LIMIT_TOLERANCE)))

    def passed(
        self, objects: Sequence[Any] | Ints, values: ArrayLike, scale: float = 1.0, **facts: object
    ) -> list[PreflightWarning]:
        """The warning of the worst of some objects, names or numbers of bodies, if its value leaves the range.

        Facts are parts of the texts; arrays have one for each object.
        """
        beyond = self.beyond(each := np.asarray(values, dtype=float))
        if not beyond.any():
            return []
        k = int(np.nanargmin(each) if self.least else np.nanargmax(each))
        value = float(each[k])
        own = {name: fact[k] if isinstance(fact, np.ndarray) else fact for name, fact in facts.items()}
        own |= {"value": _told_apart(value, self.value), "size": value * scale, "advised": "0"}
        if value > 0.0:
            ratio = value / self.value if self.least is (self.rounded is DOWN) else self.value / value
            own["advised"] = two_digits(scale * ratio, self.rounded)
        return [self._warning(objects[k], int(beyond.sum()), value, own)]

    def of(self, objects: Sequence[Any] | Ints, **facts: object) -> list[PreflightWarning]:
        """The warning of all of some objects, names or numbers of bodies, that names the first; facts are its."""
        return [self._warning(objects[0], len(objects), None, facts)] if len(objects) else []

    def _warning(self, thing: Any, count: int, value: float | None, facts: dict[str, object]) -> PreflightWarning:
        name = thing if isinstance(thing, str) else f"body {thing}"
        among = f", {'one' if value is None else 'the worst'} of {count}" if count > 1 else ""
        text = "; ".join(part for part in (self.says, self.where, self.remedy) if part).format(**facts)
        limit = None if value is None else self.value
        return PreflightWarning(self.kind, name, count, value, limit, self.section, f"{name}{among}: {text}")


def two_digits(value: float, rounded: Callable[[float], int]) -> str:
    """Two digits, rounded down or up, so that a value that follows the advice causes no warning."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return f"{rounded(value / unit) * unit:.2g}"


def rounded_up(value: float) -> str:
    """Two digits, rounded up."""
    return two_digits(value, UP)


def _told_apart(value: float, limit: float) -> str:
    """A value with three digits, or as many as tell how far it is from a limit."""
    texts = (f"{value:.{digits}g}" for digits in range(3, 18))
    return next(text for text in texts if abs(float(text) - value) <= 0.5 * abs(value - limit))


# fmt: off
# In the order of the checks; beside each limit, its test.
NOTHING = Limit(
    "nothing acts", "what-acts", nan, "nothing moves and nothing acts on it at t = 0", "",
    "use gravity, a Load, or the velocity of a wall, Support or body",
)
AWAY = Limit(
    "wall moves away", "what-acts", nan, "its velocity ({x:.3g}, {y:.3g}) m/s leads away from all bodies, and nothing"
    " follows it", "", "use the opposite velocity if it is to press",
)
OVERLAP = Limit(
    "overlap left", "overlap", 0.01, "a share of {value} of it is left after {steps} steps without inertia",
    "a step removes a fifth", "use a dt of which 21 or more steps fit in the run",
)  # test_interference
SIZE = Limit(
    "size", "sizes", 1.0, "the smallest is {size:.3g} m across, and moduli are as large as in Pa",
    "lengths are in metres", "use 1e-3 for a millimetre",
)
RESOLUTION = Limit(
    "R/h", "resolution", 3.2, "R/h = {value}",
    "piles and packings were verified from 3.2 on, Hertz's force from 5 on", "use cell = {advised} m or less",
    least=True,
)  # test_pile
SMALLEST = Limit(
    "R/h alone", "resolution", 1.0, "R/h = {value}", "bodies were verified from R/h = 2 on",
    "use cell = {advised} m or less", least=True,
)  # test_corners, unlike discs
THIN = Limit(
    "thin part", "thin-parts", 4.0, "{value} cells across its thinnest part of {size:.3g} m",
    "along the grid strips of 1, 2, 4, 8 cells bend by up to 36, 13.8, 2.2, 0.8 % too little",
    "use cell = {advised} m or less", least=True,
)  # test_thin_parts
INCLINED = Limit(
    "inclined thin part", "thin-parts", 6.0,
    "{value} cells across a thin part of {size:.3g} m that is inclined to the grid",
    "at 45 degrees and nu = 0.49 strips of 4, 5, 6, 8 cells bend 10.9, 8.4, 6.5, 4.3 % too little",
    "use cell = {advised} m or less, or turn it", least=True,
)  # test_thin_parts
SLIT = Limit(
    "slit", "slits", 2.0, "{value} cells across its narrowest slit of {size:.3g} m",
    "slits of 0.5, 1, 1.5, 2, 3 cells open by up to 91, 90, 86, 8, 8 % too little",
    "use cell = {advised} m or less, or close it", least=True,
)  # test_slits
FEWEST = Limit(
    "points per cell", "points-per-cell", 1.8, "{value} points per cell of material",
    "verified from 1.8 on; with 1.3 a uniform stress was too small by up to 66 %",
    "use a spacing of {spacing} m or less", least=True,
)  # test_sampling
TORN = Limit(
    "pieces", "sampling", nan, "its cells form {pieces} pieces that share no node; simulate refuses it", "",
    "{better}",
)
# Of 1,500 discs and boxes with points 0.74 h apart six are beyond; with 0.66 h 0.009 is the most.
SOFTENING = Limit(
    "sampling", "sampling", 0.03,
    "its points miss or misplace parts of cells, so a uniform stress is too small by about {value}",
    "a spacing of 0.66 h leaves at most 0.01", "{better}",
)  # test_sampling
COURANT = Limit(
    "dt c/h", "waves", LONG, "dt c/h = {value}", "verified up to 15 where waves matter",
    "use dt = {advised} s or less",
)  # test_dynamics, stability
LID = Limit(
    "stroke of a step", "motion-per-step", STROKE, "moves {value} h a step",
    "verified for lids of packings that move by 0.08 to 0.14", "use dt {advised} times as long",
)  # test_interpenetration, R/h = 5 and 8
APPROACH = Limit(
    "approach in a step", "motion-per-step", MAX_APPROACH, "up to {value} h a step past each other{fallen}",
    "collisions were verified up to 0.2, beyond 1 a step fails", "use dt {advised} times as long",
)  # test_collision
FLOW = Limit(
    "plastic flow", "incompressibility", nan, "{material} without mean dilatation",
    "plastic flow locks: a notched bar had no limit load, but forces 21 % above it and more",
    "use Scheme(mean_dilatation=None), the default",
)  # test_plastic_flow
LOCKING = Limit(
    "locking", "incompressibility", NEARLY_INCOMPRESSIBLE, "nu = {nu:g} without mean dilatation",
    "at 0.4, 0.45, 0.49 a disc of R/h = 5 is 8, 10, 22 % too stiff, the peak pressure 1.4, 1.9, 4.2 times too high",
    "use Scheme(mean_dilatation=None), the default",
)  # test_mean_dilatation
POISSON = Limit(
    "nu", "incompressibility", 0.49999, "nu = {value}", "mean dilatation was verified up to 0.49999",
    "use 0.49999 or less",
)  # test_locking
MULTIGRID = Limit(
    "nu with amg", "incompressibility", 0.499, "nu = {value}",
    "amg takes 130 iterations at 0.499, 430 at 0.49999", "use linear.banded",
)  # test_locking
CONFINED = Limit(
    "nu with few points", "incompressibility", 0.48, "nu = {value} with fewer than 3.5 points per cell",
    "squeezed into 0.98 of its area, a disc with points 0.74 h apart is 1 % too soft at 0.49, 11 % at 0.499",
    "use a spacing of {spacing} m or less",
)  # test_confined; a block with points 0.8 h apart is a third too soft at 0.49 where it is confined
AUXETIC = Limit(
    "negative nu", "incompressibility", 0.0, "nu = {value} is negative, which is rare", "",
    "check its moduli, or `bulk` of a rubber", least=True,
)
STIFFNESS = Limit(
    "ratio of E", "unequal-bodies", 100.0, "ratio of E {value}",
    "collisions and squeezed discs were verified up to 100", "use a ratio of at most 100",
)  # tests/extremes/test_parameters
BONDED = Limit(
    "ratio of E of parts", "unequal-bodies", 1e5, "ratio of E {value}",
    "parts of one body were verified up to 1e6 in laminates", "use a ratio of at most 100000",
)  # test_composite
DENSITY = Limit(
    "ratio of density", "unequal-bodies", 1e4, "ratio of density {value}",
    "verified for a disc at rest on one 1e4 times lighter", "use a ratio of at most 10000",
)  # test_pile
LAYER = Limit(
    "layer", "layers", 4.0, "about {value} cells thick, and shares cells with other groups",
    "interfaces inside cells cost up to 9 % with 8 cells a layer, twice that with 4",
    "use interfaces on grid lines, or cell = {advised} m or less", least=True,
)  # test_composite
FRICTION = Limit(
    "friction", "friction", 2.0, "friction = {value}", "the contact solver was verified up to 2",
    "use 2 or less, at 2 there is little slip",
)  # test_contact_solver
COHESION = Limit(
    "cohesion over E", "cohesion", 0.1, "cohesion = {cohesion:g} Pa is {value} of E",
    "pull-off was verified up to a tenth of Young's modulus", "use {advised} Pa or less",
)  # test_adhesion
PEELING = Limit(
    "range of cohesion", "cohesion", 0.5, "range is {value} of cohesion / E cells",
    "with less, flat blocks come off up to 10 % too early", "use cohesion_range = {advised} m or more",
    least=True, rounded=UP,
)  # test_adhesion
ZONE = Limit(
    "points in the range of cohesion", "cohesion", 2.5, "range covers {value} boundary points a side",
    "with less, a round body comes off at the force of a few boundary points",
    "use a larger cohesion_range or a smaller spacing", least=True,
)  # test_adhesion
GLIDE = Limit(
    "contact width on slopes", "gentle-slopes", LIGHT,
    "its weight widens contacts to {value} boundary segments on either side",
    f"discs rolled on slopes of 1 degree up to {LIGHT:g}, wider contacts stopped them below 6 degrees",
    "use a stiffer material or, to average over segments, cell = {cell} m or less",
)  # test_rolling
ROTATION = Limit(
    "rotation", "small-strain", 0.05, "{material} rotates by 0.05 rad in {steps:.3g} steps",
    "a rotation by 0.05 rad causes a spurious strain of 0.00125, which grows with its square", "use NeoHookean",
)  # test_dynamics
MAY_ROTATE = Limit(
    "possible rotation", "small-strain", nan, "{material}, and {cause} may rotate it by more than 0.05 rad",
    ROTATION.where, "use NeoHookean",
)
FALLS_FOR_EVER = Limit(
    "periodic gravity", "periodic-boxes", nan,
    "gravity = ({x:g}, {y:g}) m/s2 accelerates the whole packing for ever, as nothing holds it", "",
    "use no gravity, or a Support, a Spring or a rigid body with motion",
)
TENSION = Limit(
    "periodic tension", "periodic-boxes", nan,
    "stress = {pull:g} Pa is tension, which contacts without cohesion do not bear, and the box grows for ever", "",
    "use a negative stress for a pressure, or cohesion",
)
REGRIDDING = Limit(
    "theta with anchor", "scheme", nan, "theta = {theta:g} with anchor = {anchor:g}",
    "regridding adds energy to bodies that vibrate: 3 to 17 % in 240 steps, sixfold at nu = 0.49",
    "use anchor = inf or theta = 1",
)
LASTING = Limit(
    "theta with contact", "scheme", nan, "theta = {theta:g} with contact that lasts",
    "collisions of two were verified, and that what rolls keeps its speed; forces may swing between steps",
    "use theta = 1",
)
SHARED_GRID = Limit(
    "shared grid", "scheme", nan, "contact = shared_grid", "contact begins one to two and a half cells too early",
    "use contact.point_to_curve",
)
IGNORED = Limit(
    "velocities without inertia", "scheme", nan, "inertia = False ignores the initial velocities of bodies", "",
    "remove them or use inertia",
)
EDGE = Limit(
    "sharp edge", "rigid-edges", nan,
    "an edge at ({x:.4g}, {y:.4g}) m sharper than 0.5 h meets body {soft} without inertia",
    "a flat punch with rounder edges reached 40 % of the height, with sharper ones in cases only 25 %",
    "use inertia, or a radius of {radius:.4g} m",
)  # test_punch
# fmt: on
