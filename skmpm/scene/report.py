"""The report of a step: cost, residuals, energy budget and step control."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

from skmpm.representation import line, quantity, table


@dataclass(frozen=True)
class Energy:
    """The energy budget [J/m]; terms other than kinetic, elastic and springs are sums since t = 0.

    Attributes
    ----------
    kinetic : energy of the nodal velocities, in a periodic box relative to its motion at the centres of bodies, of
        free rigid bodies and, with inertia, of walls that a force or a pressure drives
    elastic : including the ghost penalty, and what hardening of materials stores
    external : work of gravity, loads, supports, moving ends of springs, and walls, or what drives them; of a periodic
        box by contacts across its edges and on bodies that move relative to it. With inertia forces are those at
        t + theta dt: with theta = 1 the work of a load that grows slowly in n equal steps is larger than by the
        trapezoidal rule by 1/n
    push_out : work of contacts that remove an overlap of an earlier step
    cohesion : work of cohesive contacts on gaps that close, negative where they open
    regridding : change of the points' energy by regridding
    viscous : dissipated by the viscosity of materials
    plastic : dissipated by changes of internal variables of materials, as by plastic flow
    springs : stored in springs
    dissipated : the remainder: friction, impacts, the time scheme, the transfer, changes of the state by the user and
        of springs by a stage
    gained : energy gained without work in steps, negative where it is dissipated; without what happens between them
    largest : largest of these energies since t = 0
    """

    kinetic: float = 0.0
    elastic: float = 0.0
    external: float = 0.0
    push_out: float = 0.0
    cohesion: float = 0.0
    regridding: float = 0.0
    viscous: float = 0.0
    plastic: float = 0.0
    springs: float = 0.0
    dissipated: float = 0.0
    gained: float = 0.0
    largest: float = 0.0


@dataclass(frozen=True)
class StepControl:
    """Step control of `simulate`: with a requested dt, after failures the next step is dt / 2^halvings.

    Attributes
    ----------
    dt : requested step [s]; 0 if steps are chosen
    halvings : number of halvings of the requested step
    successes : successful steps since the last failure or doubling
    part : completed part of the requested step [1/1024]
    chosen : where steps are chosen, length of the next one at most [s]; 0 before the first
    began : time [s] at which the run or the stage began, from which on functions of time are looked at
    """

    dt: float = 0.0
    halvings: int = 0
    successes: int = 0
    part: int = 0
    chosen: float = 0.0
    began: float = 0.0


@dataclass(frozen=True, repr=False)
class Report:
    """Cost and residuals of a step.

    Attributes
    ----------
    dt : length of the step [s]
    inertia : whether bodies had inertia in it; if not, velocities are displacements over its length
    retries : failures of longer steps before this one
    newton : Newton iterations
    factorisations : factorisations of A
    contact : iterations of the contact solver, over all Newton iterations
    residual : natural-map residual of the contact law at the end of the step
    imbalance : residual of the momentum balance over the largest of its terms
    solves : number of solves of a static step, each about the solution before (`step.statics`); one in dynamic steps
    unbalanced : largest resultant force on a body over the mean contact force (`step.report`)
    overlap : area shared by bodies / area of all bodies
    energy : energy budget, an `Energy`
    seconds : wall time by phase [s]
    """

    dt: float = 0.0
    inertia: bool = True
    retries: int = 0
    newton: int = 0
    factorisations: int = 0
    contact: int = 0
    residual: float = 0.0
    imbalance: float = 0.0
    solves: int = 1
    unbalanced: float = 0.0
    overlap: float = 0.0
    energy: Energy = Energy()
    seconds: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        return line("Report", self._facts())

    def _repr_html_(self) -> str:
        return table(
            "Report", self._facts() | {f"{name} [s]": f"{value:.3g}" for name, value in self.seconds.items()}
        )

    def _facts(self) -> dict[str, object]:
        facts: dict[str, object] = {"dt =": quantity(self.dt, "s"), "Newton iterations": self.newton}
        facts |= {"contact iterations": self.contact, "retries": self.retries, "residual": f"{self.residual:.2g}"}
        facts |= {"imbalance": f"{self.imbalance:.2g}", "overlap": f"{self.overlap:.2g}"}
        return facts | {"took": quantity(sum(self.seconds.values()), "s")}


@dataclass
class Timer:
    """Seconds by phase, for the report."""

    seconds: dict[str, float] = field(default_factory=dict)
    _since: float = field(default_factory=perf_counter)

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to `phase`."""
        now = perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._since
        self._since = now
