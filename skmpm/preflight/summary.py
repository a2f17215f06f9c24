"""The preflight check: the numbers of a run before it starts as text, and warnings outside the verified range."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import ceil

from skmpm.contact import acts_at_grid_nodes
from skmpm.contact.boundary import check_outlines
from skmpm.material import is_linear, poisson_ratio, youngs_modulus
from skmpm.preflight.explain import about
from skmpm.preflight.limits import PreflightWarning, warnings_of
from skmpm.preflight.metrics import SceneMetrics, chosen_steps
from skmpm.representation import quantity, span, table
from skmpm.scene import Scene, check_scene, check_walls_at_start
from skmpm.scheme import Scheme
from skmpm.step.algorithm import SHORTEST, check_time
from skmpm.step.driven_walls import check_driven
from skmpm.step.initial_state import check_contact, check_scheme
from skmpm.stepping.step_length import Pace, pace_of


def _duration(seconds: float) -> str:
    """A time of a run as text, with one digit."""
    unit, name = next((u, name) for u, name in ((3600.0, "h"), (60.0, "min"), (0.0, "s")) if seconds >= u)
    return f"{float(f'{seconds / (unit or 1.0):.1g}'):g} {name}"


@dataclass(frozen=True, eq=False, repr=False)
class Preflight(SceneMetrics):
    """The preflight check of a scene, printed as text; in a notebook a table.

    Attributes
    ----------
    scene : the scene
    dt : the time step, or the first that `simulate` chooses [s]
    scheme : the scheme
    until : end of the run [s], if it was given
    steps : number of steps until then
    chosen : whether `simulate` chooses the length of steps
    seconds : time that a step takes, about [s]
    memory : memory besides that of the program, about [MB]
    unknowns : number of unknowns
    warnings : warnings of numbers outside the verified range, at most one of a kind, `PreflightWarning`

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> check = skmpm.preflight(scene, 1e-3, until=1e-2)
    >>> check.dt, check.steps, check.chosen
    (0.001, 10, False)
    >>> str(check).splitlines()[0]
    'bodies    1, rigid 0; walls 0, supports 0, loads 0'
    """

    warnings: tuple[PreflightWarning, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "warnings", tuple(warnings_of(self)))

    def __str__(self) -> str:
        """The lines, then a line that begins with ``!`` for each warning."""
        said = [*(f"! {warning}" for warning in self.warnings), *about(self.warnings)] or ["no warnings"]
        return "\n".join([*(f"{name:8s}  {text}" for name, text in self.lines.items()), *said])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        said = {f"! {warning.kind}": str(warning) for warning in self.warnings}
        return table("Preflight", self.lines | (said or {"": "no warnings"}))

    @property
    def lines(self) -> dict[str, str]:
        """The numbers as text, by subject."""
        scene, scheme, diameter = self.scene, self.scheme, 2.0 * self.resolution * self.cell
        sizes = dict.fromkeys(quantity(float(each), "m") for each in (diameter.min(), diameter.max()))
        law = "linear, one solve" if all(map(is_linear, scene.materials)) else "nonlinear, Newton"
        moduli, ratios = self.extremes(youngs_modulus), self.extremes(poisson_ratio)
        name, stroke = self.driven
        lines = {
            "bodies": f"{_bodies(scene)}; {_around(scene)}",
            "sizes": f"{' to '.join(sizes)} across; cells of {quantity(self.cell, 'm')}",
            "points": f"{self.points.sum()}, {span(self.points, 'd')} a body,"
            f" {self.points_per_cell.min():.3g} or more per filled cell",
            "grid": f"{self.grid.cells} cells, {self.unknowns} unknowns",
            "R/h": f"{self.resolution.min():.3g} smallest, {self.resolution.mean():.3g} mean; {self._widths()}",
            "dt c/h": self._waves(),
            "driven": f"{name}, {stroke:.3g} h a step" if stroke else name or "nothing",
            "motion": self._motion(),
            "bulk": f"E = {span(moduli, '.4g')} Pa, nu = {span(ratios, '.5g')}; {law};"
            f" {f'theta = {scheme.theta:g}' if scheme.inertia else 'quasi-static'}",
            "contact": self._contact(),
            "solver": f"{self.solver}, half bandwidth {self.half_bandwidth}",
            "memory": f"about {_bytes(self.memory)} besides the program",
            "cost": self._cost(),
        }
        return lines | ({"step": self._step()} if self.chosen else {})

    def _widths(self) -> str:
        across, slit = self.across[self.across > 0.0], self.slit.min()
        narrowest = f", {slit:.3g} the narrowest slit" if slit < float("inf") else ""
        return f"{across.min():.3g} cells across the thinnest part{narrowest}" if across.size else "no outlines"

    def _waves(self) -> str:
        c = f"c = {self.scene.fastest_wave:.4g} m/s"
        return f"{self.courant:.3g}, {c}" if self.scheme.inertia else "none without inertia"

    def _motion(self) -> str:
        if not self.touches:
            return "nothing else can touch it"
        if not self.scheme.inertia:
            return "from equilibrium to equilibrium, nothing falls without inertia"
        after = f", after falling by {self.fall:.3g} m" if self.fall else ""
        return f"{self.approach:.3g} h a step past each other{after}"

    def _contact(self) -> str:
        if not self.touches:
            return "of bodies with themselves only"
        contact = self.scheme.contact
        name = getattr(contact, "__name__", type(contact).__name__).replace("_", " ")
        cohesion = f", cohesion up to {self.cohesion:g} Pa" if self.cohesion else ""
        return f"{name}, {self.scene.frictions}{cohesion}"

    def _cost(self) -> str:
        each = f"{self.seconds_of_step:.1g} s"
        if self.seconds is None or self.steps is None or self.until is None:
            return f"about {each} a step"
        about = f"about {self.steps} steps of {each} or more: {_duration(self.seconds)}"
        if not (self.chosen and self._pace.losses):
            return about
        most = max(ceil(self.until / self._pace.resolving), self.steps)
        return f"{about}; up to {most}, {_duration(most * self.seconds_of_step)}, while bodies vibrate or meet"

    @cached_property
    def _pace(self) -> Pace:
        """What limits chosen steps."""
        return pace_of(self.scene, self.scheme, 0.0, self.until or 0.0)

    def _step(self) -> str:
        """The first step, and whether chosen ones pass over impacts."""
        passes = self.scheme.inertia and self.touches and not self._pace.losses
        passed_over = "; impacts of so many bodies are not resolved, unless waves=True" if passes else ""
        return f"chosen, {self.dt:.3g} s at first{passed_over}"


def preflight(
    scene: Scene,
    dt: float | None = None,
    *,
    scheme: Scheme = Scheme(),  # noqa: B008
    until: float | None = None,
) -> Preflight:
    """Check a run before it starts: sizes, resolution, motion per step, solver, time, memory; and warnings.

    Body grids are built, nothing is solved. Motions are those at t = 0, including what bodies gain by falling; with
    `until` walls and supports that are functions of time count by their largest speeds. In the printed text a line
    that begins with ``!`` is a warning: object, value, what was verified, the remedy and, in brackets, the name of
    the section that `explain` prints. `simulate` logs the same warnings.

    Parameters
    ----------
    scene : the scene
    dt : length of the steps [s]; None: the first that `simulate` chooses by what acts at t = 0
    scheme : how steps are solved
    until : end of the run [s], for an estimate of the number of steps and of the time that the run takes, to an order
        of magnitude

    Returns
    -------
    numbers and warnings, printed as text

    Raises
    ------
    ValueError
        if dt is not positive
    SceneError
        if a velocity is not finite, steps cannot be chosen, or `initial` refuses the scene, as where bodies that may
        touch have no outline

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> check = skmpm.preflight(scene, 1e-3, until=1e-2)
    >>> check.steps
    10
    >>> [warning.kind for warning in check.warnings]
    ['dt c/h']
    """
    check_scene("preflight", scene)
    check_scheme("preflight", scheme)
    if dt is not None:
        check_time("preflight: dt", dt, SHORTEST, "None for chosen steps, or a time step greater than zero")
    if until is not None:
        check_time("preflight: until", until, SHORTEST, "the time to stop at")
    check_contact("preflight", scene, scheme)
    check_walls_at_start(scene)
    check_driven("preflight", scene)
    if scene.can_touch and not acts_at_grid_nodes(scheme.contact):
        check_outlines(scene)
    if dt is None:
        first, steps = chosen_steps(scene, scheme, until)
        return Preflight(scene, first, scheme, until, steps, chosen=True)
    steps = None if until is None else ceil(until / dt - 1e-9)
    return Preflight(scene, dt, scheme, until, steps, chosen=False)


def _bodies(scene: Scene) -> str:
    free = f" ({scene.free_rigid.size} free)" if scene.free_rigid.size else ""
    return f"{len(scene.bodies)}, rigid {(~scene.deformable).sum()}{free}"


def _around(scene: Scene) -> str:
    """What acts on bodies: numbers of walls or the periodic box, numbers of supports, loads and springs."""
    box, springs = scene.periodic, f", springs {len(scene.springs)}" if scene.springs else ""
    walls = f"walls {len(scene.walls)}"
    if box is not None:
        sides = [
            f"{name} {length:.4g} m" for name, length in (("width", box.width), ("height", box.height)) if length
        ]
        walls = f"periodic box, {' and '.join(sides)}" + (f", {walls}" if scene.walls else "")
    return f"{walls}, supports {len(scene.supports)}, loads {len(scene.loads)}{springs}"


def _bytes(number: float) -> str:
    return f"{number / 1e9:.2g} GB" if number >= 1e9 else f"{number / 1e6:.0f} MB"
