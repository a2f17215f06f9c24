"""The verified range: one table of limits. An entry measures a quantity of a scene, compares it, and warns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import ROUND_OFF, Bools
from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.boundary import PUSH_OUT
from skmpm.contact.closest_points import LIGHT
from skmpm.material import has_memory, poisson_ratio, youngs_modulus
from skmpm.preflight import quantities as of
from skmpm.preflight.edges import edge_radii
from skmpm.preflight.metrics import SceneMetrics
from skmpm.preflight.quantities import Reading, ceiled, floored
from skmpm.preflight.slopes import wide_contacts
from skmpm.scheme import NEARLY_INCOMPRESSIBLE
from skmpm.step.equations import LONG
from skmpm.step.no_equilibrium import MIN_EDGE_RADIUS
from skmpm.stepping.step_length import MAX_APPROACH, STROKE
from skmpm.stepping.watches import MAX_LINEAR_ROTATION

PASCALS = 1e4  # modulus from which on moduli are taken to be in Pa, and lengths then to be in metres


@dataclass(frozen=True)
class PreflightWarning:
    """Something outside of the verified range, or choices that do not go together; printed as a sentence.

    Attributes
    ----------
    kind : what is limited, as "R/h"; at most one warning of a kind is given
    object : what is concerned, as "body 3": the worst, where it is one of several
    count : number of objects that are concerned
    value, limit : value of the worst object, and the end of the verified range; None where choices do not go together
    section : name of the section that `explain` prints
    text : object, value, what was verified, remedy

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> warning = skmpm.preflight(scene, 1e-3).warnings[0]
    >>> warning.kind, warning.object, warning.limit
    ('dt c/h', 'step', 15.0)
    >>> str(warning)[:38]
    'step: dt c/h = 91.7; verified up to 15'
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
    """An entry of the table: the range of a quantity that was verified, and what is said of scenes beyond it.

    In the text {value} is that of the worst place, {limit} the end of the range, {size} the value times the scale of
    the reading; {smaller} and {larger} are the scale made as much smaller or larger as the value has to change.
    """

    kind: str
    section: str  # of preflight.explain.WARNINGS
    value: float  # end of the verified range; nan where choices do not go together
    measure: Callable[[SceneMetrics], Reading | None]  # None where nothing is limited
    text: str  # of the object, its value; what was verified; remedy
    test: str = ""  # in which it was verified
    least: bool = False  # whether the range begins here instead of ending
    unless: str = ""  # kind of a warning that makes this one superfluous

    def beyond(self, values: ArrayLike) -> Bools:
        """Whether values leave the range by more than round-off."""
        if np.isnan(self.value):
            return np.ones_like(values, dtype=bool)
        if self.least:
            return np.asarray(np.less(values, self.value * (1.0 - ROUND_OFF)))
        return np.asarray(np.greater(values, self.value * (1.0 + ROUND_OFF)))

    def warning(self, metrics: SceneMetrics) -> PreflightWarning | None:
        """The warning of the worst place, if its value leaves the range."""
        reading = self.measure(metrics)
        if reading is None:
            return None
        values = np.broadcast_to(np.asarray(reading.values, dtype=float), len(reading.places))
        count = np.unique(np.asarray(reading.places)[self.beyond(values)]).size
        if count == 0:
            return None
        k = int(np.nanargmin(values) if self.least else np.nanargmax(values))
        place, choice = reading.places[k], np.isnan(self.value)
        name = place if isinstance(place, str) else f"body {place}"
        among = f", {'one' if choice else 'the worst'} of {count}" if count > 1 else ""
        facts = {key: fact[k] if isinstance(fact, np.ndarray) else fact for key, fact in reading.facts.items()}
        text = self.text.format(**self._numbers(float(values[k]), reading.scale), **facts)
        value, limit = (None, None) if choice else (float(values[k]), self.value)
        return PreflightWarning(self.kind, name, count, value, limit, self.section, f"{name}{among}: {text}")

    def _numbers(self, value: float, scale: float) -> dict[str, str]:
        """The numbers that texts may have."""
        told = {"value": _told_apart(value, self.value), "limit": f"{self.value:g}", "size": f"{value * scale:.3g}"}
        if 0.0 < value < np.inf and self.value > 0.0:
            share = value / self.value if self.least else self.value / value
            told |= {"smaller": floored(scale * share), "larger": ceiled(scale / share)}
        return told


def _told_apart(value: float, limit: float) -> str:
    """A value with three digits, or as many as tell how far it is from a limit."""
    texts = (f"{value:.{digits}g}" for digits in range(3, 18))
    return next((text for text in texts if abs(float(text) - value) <= 0.5 * abs(value - limit)), f"{value:.3g}")


def warnings_of(metrics: SceneMetrics) -> Iterator[PreflightWarning]:
    """The warnings of everything outside of the verified range, at most one of a kind."""
    said = set[str]()
    for limit in LIMITS.values():
        if limit.unless not in said and (warning := limit.warning(metrics)):
            said.add(limit.kind)
            yield warning


# fmt: off
TABLE = (
    Limit("nothing acts", "what-acts", nan, of.idle,
          "nothing moves and nothing acts on it at t = 0; use gravity, a Load, or the velocity of a wall, Support"
          " or body"),
    Limit("wall moves away", "what-acts", nan, of.leaving_walls,
          "its velocity ({x:.3g}, {y:.3g}) m/s leads away from all bodies, and nothing follows it; use the opposite"
          " velocity if it is to press"),
    Limit("wall is pulled away", "what-acts", nan, of.pulled_walls,
          "its force or pressure, {by:.3g}, leads away from the bodies; use a positive one, which presses"),
    Limit("overlap left", "overlap", 0.01,
          lambda m: Reading(["overlap"], (1.0 - PUSH_OUT) ** m.steps, facts={"steps": m.steps})
          if m.steps is not None and m.scene.overlap > 0.0 and not m.scheme.inertia else None,
          "a share of {value} of it is left after {steps} steps without inertia; a step removes a fifth; use a dt"
          " of which 21 or more steps fit in the run", "test_interference"),
    Limit("size", "sizes", 1.0,
          lambda m: Reading(["bodies"], 2.0 * m.resolution.min() * m.cell)
          if m.touches and m.extremes(youngs_modulus).min() > PASCALS else None,
          "the smallest is {value} m across, and moduli are as large as in Pa; lengths are in metres; use 1e-3 for"
          " a millimetre"),
    Limit("weight over E", "sizes", 1.0, of.weight,
          "density, gravity and the height of all bodies make {weight:.3g} Pa, {value} of its E; four rows of discs"
          " came to rest at {limit}, at 3 they overlapped; use a modulus in Pa with a density in kg/m3 and lengths in"
          " metres", "test_pile"),
    Limit("R/h", "resolution", 3.2, lambda m: Reading(m.own, m.resolution, m.cell) if m.touches else None,
          "R/h = {value}; piles and packings were verified from {limit} on, Hertz's force from 5 on; use cell ="
          " {smaller} m or less", "test_pile, test_hertz", least=True),
    Limit("R/h alone", "resolution", 1.5, lambda m: None if m.touches else Reading(m.own, m.resolution, m.cell),
          "R/h = {value}; bodies were verified from {limit} on; use cell = {smaller} m or less",
          "test_parameters", least=True),
    Limit("thin part", "thin-parts", 4.0, lambda m: Reading(m.own, m.across + m.chords, m.cell),
          "{value} cells across its thinnest part of {size} m; along the grid strips of 1, 2, 4, 8 cells bend by up"
          " to 36, 13.8, 2.2, 0.8 % too little; use cell = {smaller} m or less", "test_thin_parts", least=True),
    Limit("inclined thin part", "thin-parts", 6.0, of.inclined_parts,
          "{value} cells across a thin part of {size} m that is inclined to the grid; at 45 degrees and nu = 0.49"
          " strips of 4, 5, 6, 8 cells bend 10.9, 8.4, 6.5, 4.3 % too little; use cell = {smaller} m or less, or"
          " turn it", "test_thin_parts", least=True, unless="thin part"),
    Limit("slit", "slits", 2.0, lambda m: Reading(m.own, m.slit + m.chords, m.cell),
          "{value} cells across its narrowest slit of {size} m; slits of 0.5, 1, 1.5, 2, 3 cells open by up to 91,"
          " 90, 86, 8, 8 % too little; use cell = {smaller} m or less, or close it", "test_slits", least=True),
    Limit("tip", "sharp-tips", 50.0, of.tips,
          "a tip of {value} degrees at ({x:.4g}, {y:.4g}) m, over a cell to either side; of three packings of rhombi"
          " with tips of 60, 50, 40, 30, 20 degrees 3, 3, 1, 1, 0 bore 3 % of E; use a tip rounded by {radius} m",
          "test_tips", least=True),
    Limit("points per cell", "points-per-cell", 1.8,
          lambda m: Reading(m.own, m.points_per_cell, facts={"spacing": floored(0.74 * m.cell)}),
          "{value} points per cell of material; verified from {limit} on; with 1.3 a uniform stress was too small"
          " by up to 66 %; use points {spacing} m apart or less", "test_sampling, test_patch", least=True),
    Limit("pieces", "sampling", nan, of.pieces,
          "its cells form {pieces} pieces that share no node; simulate refuses it; {better}"),
    # Of 1,500 discs and boxes with points 0.74 h apart six are beyond; with 0.66 h 0.009 is the most.
    Limit("error of a uniform stress", "sampling", 0.03, of.stress_error,
          "its points miss or misplace parts of cells, so a uniform stress is too small by about {value}; a spacing"
          " of 0.66 h leaves at most 0.01; {better}", "test_sampling"),
    Limit("dt c/h", "waves", LONG, of.waves,
          "dt c/h = {value}; verified up to {limit} where waves matter; use dt = {smaller} s or less, or"
          " none: chosen steps lose little energy",
          "test_dynamics"),
    Limit("stroke of a step", "motion-per-step", STROKE,
          lambda m: Reading([m.driven[0]], m.driven[1]) if m.touches else None,
          "moves {value} h a step, the farthest of all that is driven; lids that squeeze discs were verified up to"
          " {limit}; use dt {smaller} times as long, or none: chosen steps keep to it", "test_interpenetration"),
    Limit("approach in a step", "motion-per-step", MAX_APPROACH, of.approach,
          "up to {value} h a step past each other{fallen}; collisions were verified up to {limit}, a step far"
          " beyond that fails; use dt {smaller} times as long", "test_collision"),
    Limit("plastic flow", "incompressibility", nan,
          lambda m: of.made_of(m, has_memory) if m.scheme.mean_dilatation is False else None,
          "{material} without mean dilatation; plastic flow locks: a notched bar had no limit load, but forces 21 %"
          " above it and more; use Scheme(mean_dilatation=None), the default", "test_plastic_flow"),
    # at the limit itself a step already counts a body as nearly incompressible
    Limit("nu without mean dilatation", "incompressibility", NEARLY_INCOMPRESSIBLE * (1.0 - 4.0 * ROUND_OFF),
          lambda m: of.nu(m) if m.scheme.mean_dilatation is False else None,
          "nu = {value} without mean dilatation; at 0.4, 0.45, 0.49 a disc of R/h = 5 is 8, 10, 22 % too stiff, the"
          " peak pressure 1.4, 1.9, 4.2 times too high; use Scheme(mean_dilatation=None), the default",
          "test_mean_dilatation"),
    Limit("nu", "incompressibility", 0.49999, lambda m: None if m.scheme.mean_dilatation is False else of.nu(m),
          "nu = {value}; mean dilatation was verified up to {limit}; `bulk` of a rubber may be in other units than"
          " its other moduli; use {limit} or less", "test_locking"),
    Limit("nu with amg", "incompressibility", 0.499,
          lambda m: of.nu(m) if m.scheme.mean_dilatation is not False and m.solver == "amg" else None,
          "nu = {value}; amg takes 150 iterations at {limit}, 500 at 0.49999; use linear.banded",
          "test_locking", unless="nu"),
    # A block with points 0.8 h apart is a third too soft at 0.49 where it is confined.
    Limit("nu with few points", "incompressibility", 0.48, of.confined,
          "nu = {value} with fewer than {points} points per cell; squeezed into 0.98 of its area, a disc with"
          " points 0.74 h apart is 1 % too soft at 0.49, 16 % at 0.499; use points {spacing} m apart or less",
          "test_confined"),
    Limit("least nu", "incompressibility", 0.0, lambda m: Reading(m.own, m.extremes(poisson_ratio)[0]),
          "nu = {value} is negative, which is rare; check its moduli, or `bulk` of a rubber", least=True),
    Limit("ratio of E", "unequal-bodies", 100.0, lambda m: of.of_pair(m.own, *m.extremes(youngs_modulus)),
          "ratio of E {value}; collisions and squeezed discs were verified up to {limit}; use a ratio of at most"
          " {limit}", "test_parameters"),
    Limit("ratio of density", "unequal-bodies", 1e4, of.densities,
          "ratio of density {value}; verified for a disc at rest on one {limit} times lighter; use a ratio of at"
          " most {limit}", "test_pile"),
    Limit("ratio of E of parts", "unequal-bodies", 1e5,
          lambda m: Reading(m.own, np.divide(*m.extremes(youngs_modulus)[::-1])),
          "ratio of E {value}; parts of one body were verified up to 1e6 in laminates; use a ratio of at most"
          " {limit}", "test_composite"),
    Limit("layer", "layers", 4.0, of.layers,
          "about {value} cells thick, and shares cells with other groups; interfaces inside cells cost up to 10 %"
          " with 8 cells a layer, twice that with 4; use interfaces on grid lines, or cell = {smaller} m or less",
          "test_composite", least=True),
    Limit("friction", "friction", 2.0,
          lambda m: Reading([m.scene.frictions.largest_pair()], m.scene.frictions.largest) if m.touches else None,
          "friction = {value}; the contact solver was verified up to {limit}; use {limit} or less, at 2 there is"
          " little slip", "test_contact_solver"),
    Limit("cohesion over E", "cohesion", 0.1,
          lambda m: Reading(m.own, m.cohesion / m.extremes(youngs_modulus)[0], m.cohesion, {"cohesion": m.cohesion}),
          "cohesion = {cohesion:g} Pa is {value} of E; pull-off was verified up to a tenth of Young's modulus; use"
          " {smaller} Pa or less", "test_adhesion"),
    Limit("range of cohesion", "cohesion", 0.5, of.peeling,
          "range is {value} of cohesion / E cells; with less, flat blocks come off up to 10 % too early; use"
          " cohesion_range = {larger} m or more", "test_adhesion", least=True),
    Limit("points in the range of cohesion", "cohesion", 2.5, of.covered_points,
          "range covers {value} boundary points a side; with less, a round body comes off at the force of a few"
          " boundary points; use a larger cohesion_range or a smaller spacing", "test_adhesion", least=True),
    Limit("contact width on slopes", "gentle-slopes", LIGHT, wide_contacts,
          "its weight widens contacts to {value} boundary segments on either side; discs rolled on slopes of 1"
          " degree up to {limit}, wider contacts stopped them below 6 degrees; use a stiffer material or, to"
          " average over segments, cell = {cell} m or less", "test_rolling"),
    Limit("rotation", "small-strain", MAX_LINEAR_ROTATION, of.rotation,
          "{material} rotates by {value} rad in {steps} steps; a rotation by {limit} rad causes a spurious strain"
          " of 0.00125, which grows with its square; use NeoHookean", "test_dynamics"),
    Limit("possible rotation", "small-strain", MAX_LINEAR_ROTATION, of.possible_rotation,
          "{material}, and {cause} may rotate it by more than {limit} rad; a rotation by {limit} rad causes a"
          " spurious strain of 0.00125, which grows with its square; use NeoHookean",
          "test_dynamics", unless="rotation"),
    Limit("stretch of the largest stress", "softening", of.MODERATE, of.softening,
          "{material} has its largest stress at a stretch of {value} at constant area, and softens beyond; strains"
          " gather there in few cells, and steps fail: a block in tension stopped at 0.97 of such a stretch; use"
          " coefficients with which stress grows up to {limit}, or keep strains below", "test_preflight", least=True),
    Limit("periodic gravity", "periodic-boxes", nan, of.endless_fall,
          "gravity = ({x:g}, {y:g}) m/s2 accelerates the whole packing for ever, as nothing holds it; use no"
          " gravity, or a Support, a Spring or a rigid body with motion"),
    Limit("periodic tension", "periodic-boxes", 0.0, of.tension,
          "stress = {pull:g} Pa is tension, which contacts without cohesion do not bear, and the box grows for ever;"
          " use a negative stress for a pressure, or cohesion"),
    Limit("theta with anchor", "scheme", nan,
          lambda m: of.choice(m) if m.scheme.theta < 1.0 and np.isfinite(m.scheme.anchor) else None,
          "theta = {theta:g} with anchor = {anchor:g}; regridding adds energy to bodies that vibrate: 6 % in 240"
          " steps at nu = 0.45, 45 % at 0.49; use anchor = inf or theta = 1"),
    Limit("theta with contact", "scheme", nan, of.lasting_contact,
          "theta = {theta:g} with contact that lasts; collisions of two were verified, and that what rolls keeps"
          " its speed; forces may swing between steps; use theta = 1"),
    Limit("shared grid", "scheme", nan,
          lambda m: of.choice(m) if m.touches and acts_at_grid_nodes(m.scheme.contact) else None,
          "contact = shared_grid; contact begins one to two and a half cells too early; use contact.point_to_curve"),
    Limit("velocities without inertia", "scheme", nan,
          lambda m: None if m.scheme.inertia or m.at_rest or not m.touches else of.choice(m),
          "inertia = False ignores the initial velocities of bodies; remove them or use inertia"),
    Limit("radius of a rigid edge", "rigid-edges", MIN_EDGE_RADIUS, edge_radii,
          "its edge at ({x:.4g}, {y:.4g}) m has a radius of {value} h, and may press on body {soft} without inertia;"
          " soft surfaces jump at sharp edges, and steps fail: 9 of 14 blocks were indented by 40 % with 0 h, 13 with"
          " {limit} h; use inertia, or an edge rounded by {radius} m with points {spacing} m apart",
          "test_punch", least=True),
)
# fmt: on
LIMITS = {limit.kind: limit for limit in TABLE}
