"""Invariants of every state of every run, checked by code that is independent of the library.

Nothing here calls the library but to run it: momentum and energies come from the points, contact laws from the list
of contacts, overlaps from points in polygons.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field

import numpy as np
from balance import ROUNDING, balance_of, behind_walls, given_forces, slip_on_walls, supports_missed, travel, value_at
from geometry import crossings, deepest, deepest_in_itself, loops_of, shared_area, shared_points
from published import ends
from scenes import Case

import skmpm

MOMENTUM = 1e-10  # of sum m |v| + dt sum |forces|, per step
ENERGY = 1e-6  # of the largest of all energies so far: Newton's tolerance; what a run may gain, in all
CONE = 1e-9  # of friction f_n, and of the largest force
UNBALANCED = 3.0  # newton_tol, which bounds the root of squares over the nodes: sums are larger, twice was seen
NEUTRAL = 1e-3  # of its forces: what a body may lack along motions without resistance, see docs/theory/method.md
MOMENT = 1e-3  # of sum |arm| |force|, and stress times area
MOMENT_MOVING = 0.05  # the same where bodies move: the transfer to points keeps it of rigid motions only; 0.026 seen
MOMENT_COARSE = 0.2  # and in collisions at up to the speed of waves at R/h = 1.5; 0.06 seen
SLIP = 1e-3  # [cells] in a step, of a contact that sticks
MISSED = 1e-3  # [cells] by the mean displacement of a support
TRAVEL = 3.0  # diameters of the largest body, in a quasi-static step
SUNK = 1e-3  # [cells] of a boundary point behind a wall that was in front of it
DEPTH = 0.15  # [cells] of a boundary point in the polygon of another body, in stacks: 0.05 where all is well
FOLD = 4.0  # [cells] along the outline between edges that cross: parts farther apart touch, as two bodies do
DEPTH_COARSE = 0.5  # [cells] in those: steps are taken back by the area of a lens 0.25 deep; 0.32 seen
OPEN = 1e-3  # [cells] gap of a contact that carries force
BEHIND = 0.05  # [cells] points behind walls
OVERLAP = 0.01  # of the bodies' area
MANY = 40  # bodies up to which points are looked for in polygons
LONG = 15.0  # [cells] that pressure waves run in a step in which bodies keep momentum to Newton's tolerance
CURVED = 0.01  # of the energy that a step exchanges: what it may gain
REMEDY = re.compile(
    r"\b(smaller|larger|use|lower|raise|add|give|move|let|finer|coarser|fewer|more|try)\b", re.IGNORECASE
)
OBJECT = re.compile(r"\b(body|bodies|wall|support|load|gravity|scene)\b")


def wave(scene: skmpm.Scene) -> float:
    """Speed of the fastest pressure wave [m/s]."""
    soft = [body.material for body in scene.bodies if not isinstance(body.material, skmpm.Rigid)]
    return max(np.sqrt(m.E * (1 - m.nu) / ((1 + m.nu) * (1 - 2 * m.nu) * m.density)) for m in soft)


@dataclass
class Outcome:
    """How a run ended: "right", "StepFailed", "SceneError", or "wrong" and in which way."""

    kind: str = "right"
    violations: list[str] = field(default_factory=list)  # the first of each sort, with the time
    message: str = ""  # of the error
    steps: int = 0
    retries: int = 0
    newton: float = 0.0  # iterations a step, mean
    reached: float = 0.0  # share of the time asked for
    worst: dict[str, float] = field(default_factory=dict)  # largest of each checked quantity, in its unit
    ends: dict[str, float] = field(default_factory=dict)  # what users publish, at the end
    state: skmpm.State | None = field(default=None, repr=False)  # the last one


def examine(case: Case, *, most: int | None = None) -> Outcome:
    """Run a case to its end, or for so many steps at most, under strict arithmetic and check every state."""
    outcome, watch = Outcome(), Watch(case)
    with np.errstate(all="raise", under="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            start = skmpm.initial(case.scene, scheme=case.scheme)
            watch.begin(start)
            for state in skmpm.simulate(case.scene, dt=case.dt, until=case.until, scheme=case.scheme, start=start):
                watch.see(state)
                if watch.steps == most:
                    break
            else:
                watch.finish()
        except skmpm.SceneError as error:
            outcome.kind, outcome.message = "SceneError", str(error)
        except skmpm.StepFailed as error:
            outcome.kind, outcome.message = "StepFailed", str(error)
            watch.failed(error)
        except TimeoutError:
            raise
        except Exception as error:  # any other is a defect
            watch.found[type(error).__name__] = f"{type(error).__name__}: {error}"
    return watch.report(outcome)


class Watch:
    """Looks at the states of a run one after the other."""

    def __init__(self, case: Case):
        self.case, self.scene = case, case.scene
        self.stack = case.name == "assembly"  # of `assemblies.py`: finer, slower, with supports and loads
        self.found: dict[str, str] = {}
        self.worst: dict[str, float] = {}
        self.steps = self.newton = self.retries = 0
        self.impulse = np.zeros(2)  # of the lid, or of the only wall
        self.external = self.start = self.largest = self.rounded = 0.0
        self.state: skmpm.State | None = None

    def begin(self, state: skmpm.State) -> None:
        """The state at t = 0."""
        self.state, self.start = state, state.report.energy.kinetic
        self.largest = self.start

    def see(self, new: skmpm.State) -> None:
        """One step later."""
        old, self.state = self.state, new
        self.steps, self.newton = self.steps + 1, self.newton + new.report.newton
        self.retries += getattr(new.report, "retries", 0)
        if not self._finite(new):
            return
        J = determinant(new.F)
        self._limit("1 - J", float(1.0 - J.min()), 1.0, new, "a point turned inside out")
        if "1 - J" in self.found:  # later energies would be those of an impossible state
            return
        self._balance(old, new)
        self._energy(old, new, J)
        self._contacts(new)
        self._sliding(old, new)
        self._sunk(old, new)
        self._prescribed(old, new)
        self._places(new)

    def finish(self) -> None:
        """After the last step: that it was the last."""
        if abs(self.state.t - self.case.until) > 1e-9 * self.case.until:
            self.found["end"] = f"ended at {self.state.t:.6g} s instead of {self.case.until:.6g} s"

    def failed(self, error: skmpm.StepFailed) -> None:
        """What a failure must tell, and that the last good state is one."""
        if "t = " not in str(error):
            self.found["message"] = "the failure does not name its time"
        reason = str(error).split("; given up after")[0]
        if not OBJECT.search(reason):
            self.found["message"] = f"the failure names no object: {error}"
        if not REMEDY.search(reason):
            self.found["message"] = f"the failure names no remedy: {error}"
        if self.state is not None and error.state.t != self.state.t:
            self.found["state"] = f"the failure's state is of t = {error.state.t:.6g} s, not of the last step"
        self._finite(error.state)

    def report(self, outcome: Outcome) -> Outcome:
        """All that was found."""
        outcome.violations = list(self.found.values())
        outcome.kind = "wrong" if self.found else outcome.kind
        outcome.steps, outcome.retries, outcome.worst = self.steps, self.retries, self.worst
        outcome.newton = self.newton / max(self.steps, 1)
        outcome.state = self.state
        if self.state is not None and "finite" not in self.found:
            outcome.reached = self.state.t / self.case.until
            outcome.ends = ends(self.case, self.state, self.impulse)
        return outcome

    def _limit(self, name: str, value: float, limit: float, state: skmpm.State, text: str) -> None:
        self.worst[name] = max(value, self.worst.get(name, -np.inf))
        if not value < limit and name not in self.found:
            self.found[name] = f"{text}: {name} = {value:.3g} at t = {state.t:.6g} s, step {self.steps}"

    def _finite(self, state: skmpm.State) -> bool:
        names = ("x", "v", "F", "C", "stress", "volume", "weight", "displacement", "wall_force", "walls")
        arrays = [getattr(state, name) for name in names] + [state.contacts.force, state.contacts.gap]
        energy = state.report.energy
        numbers = (
            energy.kinetic,
            energy.elastic,
            energy.external,
            energy.push_out,
            energy.regridding,
            energy.dissipated,
        )
        if all(np.isfinite(a).all() for a in arrays) and np.isfinite(numbers).all():
            return True
        self.found.setdefault("finite", f"not finite at t = {state.t:.6g} s, step {self.steps}")
        return False

    def _balance(self, old: skmpm.State, new: skmpm.State) -> None:
        """Change of momentum against weight, loads, contacts, walls and supports: of all, and of every body.

        Without supports a step keeps momentum to round-off, else to Newton's tolerance of the nodal forces. Without
        inertia bodies that only contact holds may lack more where their motion is neutral: then as much as the step
        reports, a root of squares over the nodes as `newton_tol` is, and at most `NEUTRAL`.
        """
        scheme, b = self.case.scheme, balance_of(self.case, old, new)
        exact = scheme.inertia and not self.scene.supports
        # The duration of a step is only known to the rounding of the times it lies between.
        rounding = 4.0 * np.finfo(float).eps * new.t / (new.t - old.t)
        elastic = 0.0 if exact else b.elastic
        left = scheme.newton_tol if scheme.inertia else max(scheme.newton_tol, min(new.report.imbalance, NEUTRAL))
        tolerance = UNBALANCED * left
        limit = MOMENTUM if exact else tolerance
        size = b.total_size + float(np.sum(elastic))
        noise = 0.0 if exact else float(b.rounding.sum())
        error = max(b.total - rounding * b.total_size - noise, 0.0) / max(size, 1e-300)
        self._limit("momentum", error, limit, new, "momentum not balanced")
        # In long steps the contact forces of a body are those of the normals before the last iteration.
        limit = limit if (new.t - old.t) * wave(self.scene) < LONG * self.scene.cell else tolerance
        noise = b.rounding if exact else b.rounding + limit * size  # the tolerance knows no bodies
        errors = np.maximum(b.force - rounding * b.force_size - noise, 0.0)
        errors /= np.maximum(b.force_size + elastic, 1e-300)
        self._limit("momentum of a body", float(np.nanmax(errors)), limit, new, "forces on a body not balanced")
        self._moment(new, b)
        if self.scene.walls:
            self.impulse = self.impulse + (new.t - old.t) * new.wall_force[min(1, len(self.scene.walls) - 1)]

    def _moment(self, new: skmpm.State, b) -> None:
        """Of bodies that no support holds, where points keep their angular momentum and contacts lie on outlines."""
        scheme = self.case.scheme
        if not (scheme.contact is skmpm.contact.point_to_curve and scheme.anchor == np.inf and scheme.theta == 1.0):
            return
        # Stress of a linear material has no moment about places at t = 0, about others by as much as they are moved.
        size, reach = b.moment_size + b.elastic * self.scene.cell, np.ptp(new.x, axis=1).max()
        noise = b.turned * size + b.rounding * reach + UNBALANCED * scheme.newton_tol * size.sum()
        error = np.maximum(np.nan_to_num(b.moment) - noise, 0.0)
        error = float((error / np.maximum(size, 1e-300)).max())
        limit = (MOMENT_MOVING if self.stack else MOMENT_COARSE) if scheme.inertia else MOMENT
        self._limit("moment", error, limit, new, "moments on a body not balanced")

    def _energy(self, old: skmpm.State, new: skmpm.State, J: np.ndarray) -> None:
        """Energies of the points, which are at most those of the nodes, against the work of walls and gravity."""
        m, energy, before = new.mass, new.report.energy, self.external
        ends = (new,) if self.case.scheme.inertia else (old, new)  # whose forces count: their mean
        for state in ends:
            self.external += self._work(old, new, state) / len(ends)
        # Far from the origin positions are rounded, at every step: so much work of gravity is not seen in them.
        far = np.finfo(float).eps * np.abs(new.x).max(axis=1)
        self.rounded += float(np.abs(given_forces(self.scene, m, new.t)).sum(axis=1) @ far)
        kinetic = 0.5 * float(m @ (new.v**2).sum(axis=0)) if self.case.scheme.inertia else 0.0
        elastic, rounding = energy.elastic, 0.0
        if not self._averages():
            elastic, rounding = self._elastic(new, J)
            self._limit(
                "elastic of points over reported - 1",
                (elastic - energy.elastic - rounding) / max(energy.elastic, self.largest, 1e-300),
                ENERGY,
                new,
                "elastic energy is not that of the points",
            )
        sizes = (self.largest, abs(self.external), energy.kinetic, energy.elastic, energy.push_out)
        self.largest = max(sizes)
        allowed = self.start + self.external + self.rounded + energy.push_out + energy.regridding + rounding
        scale = max(self.largest, 1e-300)
        if self.case.scheme.theta == 1.0 and self.case.scheme.inertia:  # other rules may gain
            self._limit("energy gained", (kinetic + elastic - allowed) / scale, ENERGY, new, "energy gained")
            fell = old.report.energy.dissipated - energy.dissipated
            if self.stack or self._concave():  # what backward Euler may gain (docs/theory/method.md)
                fell -= CURVED * self._exchanged(old, new, before)
            self._limit("dissipation undone", fell / scale, ENERGY, new, "dissipated energy came back")
        missing = max(abs(energy.external - self.external) - self.rounded, 0.0)
        self._limit("external", missing / scale, ENERGY, new, "external work is not")
        self.worst["push-out"] = max(self.worst.get("push-out", 0.0), energy.push_out / scale)

    def _concave(self) -> bool:
        """Whether compression makes the energy of a material concave: Lame's lambda below zero.

        At F = a I the energy density mu (a^2 - 1 - 2 ln a) + 2 lam (ln a)^2 has the second derivative
        2 mu + 2 mu / a^2 + 4 lam (1 - ln a) / a^2; with nu = -1/2, lam = -mu / 2, it is negative for a < 0.65.
        """
        return min(getattr(b.material, "nu", 0.0) for b in self.scene.bodies) < 0.0

    def _averages(self) -> bool:
        """Whether bodies take mean dilatations of cells, so that points alone do not tell their energy."""
        asked = self.case.scheme.mean_dilatation
        return max(getattr(b.material, "nu", 0.0) for b in self.scene.bodies) >= 0.4 if asked is None else asked

    def _work(self, old: skmpm.State, new: skmpm.State, state: skmpm.State) -> float:
        """Work from one state to the next of loads and the forces of a state on walls and supports."""
        dt, middle = new.t - old.t, 0.5 * (old.t + new.t)
        work = -dt * float((self.scene.wall_velocities(middle) * state.wall_force).sum())
        for support, force in zip(self.scene.supports, state.support_force, strict=True):
            work -= dt * float(value_at(support.velocity, middle) @ force)
        t = state.t if state is old else old.t + self.case.scheme.theta * dt
        return work + float((given_forces(self.scene, new.mass, t) * (new.x - old.x)).sum())

    def _exchanged(self, old: skmpm.State, new: skmpm.State, external: float) -> float:
        """Changes of kinetic and elastic energy in a step and its works, also at contacts, in absolute values.

        At contacts each force acts along the relative motion of the two bodies, and along that of the contact point
        in each (docs/theory/steps.md).
        """
        first, last = old.report.energy, new.report.energy
        changes = (last.kinetic - first.kinetic, last.elastic - first.elastic, self.external - external)
        contacts, moved, at_contacts = new.contacts, new.x - old.x, 0.0
        means = np.stack([moved[:, new.body == b].mean(axis=1) for b in range(len(self.scene.bodies))], axis=1)
        for k, (a, b) in enumerate(contacts.bodies.T):
            path = np.hypot(*(moved[:, contacts.point[k]] - means[:, a]))
            if b < 0:
                other = (new.walls - old.walls)[-1 - b]
            else:
                own, other = np.flatnonzero(new.body == b), means[:, b]
                path += np.hypot(*(moved[:, own[np.argmin(np.hypot(*(new.x[:, own] - contacts.x[:, [k]])))]] - other))
            path += np.hypot(*(means[:, a] - other))
            at_contacts += float(np.hypot(*contacts.force[:, k]) * path)
        return float(np.abs(changes).sum()) + at_contacts

    def _elastic(self, state: skmpm.State, J: np.ndarray) -> tuple[float, float]:
        """Of the points; and what rounding of F makes of it.

        Neo-Hookean W = mu/2 (F:F - 2 - 2 ln J) + lam/2 (ln J)^2, linear mu e:e + lam/2 (tr e)^2, e = sym F - I.
        """
        E, nu = (np.array([getattr(b.material, name) for b in self.scene.bodies]) for name in ("E", "nu"))
        mu, lam = (E / (2 * (1 + nu)))[state.body], (E * nu / ((1 + nu) * (1 - 2 * nu)))[state.body]
        # F:F - 2 - 2 ln J without the cancellation: F:F - 2 J = (F11 - F22)^2 + (F12 + F21)^2.
        F = state.F
        shear = (F[0, 0] - F[1, 1]) ** 2 + (F[0, 1] + F[1, 0]) ** 2
        W = 0.5 * mu * (shear + 2.0 * beyond_log(J)) + 0.5 * lam * np.log1p(J - 1.0) ** 2
        volume = state.weight / J
        e = 0.5 * (F + F.transpose(1, 0, 2)) - np.eye(2)[:, :, None]
        small = mu * np.square(e).sum(axis=(0, 1)) + 0.5 * lam * (e[0, 0] + e[1, 1]) ** 2
        linear = np.array([isinstance(b.material, skmpm.LinearElastic) for b in self.scene.bodies])[state.body]
        W = np.where(linear, small, W)
        # Strains are known to about 10 eps: alone that holds `least`, next to the true strain twice the product.
        elastic = float(volume @ W)
        strain = 10.0 * float(np.finfo(float).eps) if self.case.scheme.inertia else ROUNDING
        least = float(volume @ (2.0 * mu + np.abs(lam))) * strain**2
        # A quadratic form in displacements is known to so much of what their gradients could make of it.
        gradient = np.square(F - np.eye(2)[:, :, None]).sum(axis=(0, 1))
        gradient = np.where(linear | (not self.case.scheme.inertia), gradient, 0.0)
        least += 100.0 * float(np.finfo(float).eps) * float((volume * (2.0 * mu + np.abs(lam))) @ gradient)
        return elastic, least + 2.0 * float(np.sqrt(max(elastic, 0.0) * least))

    def _contacts(self, state: skmpm.State) -> None:
        """Signorini's and Coulomb's laws at the end of the step, and the residual that the library reports."""
        contacts, h = state.contacts, self.scene.cell
        tol = self.case.scheme.gap_tol
        self._limit("residual", state.report.residual, tol * (1 + 1e-12), state, "contact law not met")
        if contacts.force.shape[1] == 0:
            return
        f_n, f_t = contacts.force
        largest = max(float(np.abs(f_n).max()), 1e-300)
        on_wall = contacts.bodies[1] < 0
        wall = np.array([w.friction for w in self.scene.walls] or [0.0])
        mu = np.where(on_wall, wall[np.where(on_wall, -1 - contacts.bodies[1], 0)], self.scene.friction)
        self._limit("pull", float(-f_n.min()) / largest, CONE, state, "contacts pull")
        excess = float((np.abs(f_t) - mu * f_n * (1.0 + CONE)).max()) / (largest * max(1.0, float(mu.max())))
        self._limit("outside the cone", excess, CONE, state, "friction beyond Coulomb's cone")
        if self.case.scheme.contact is skmpm.contact.point_to_curve:
            loaded = f_n > 1e-3 * largest
            gap = float(contacts.gap[loaded].max(initial=0.0)) / h
            self._limit("loaded gap", gap, OPEN, state, "force at a gap")

    def _sliding(self, old: skmpm.State, new: skmpm.State) -> None:
        """On walls, by the points' own displacements: what sticks does not slide, friction opposes what slides."""
        outlined, theta = self.case.scheme.contact is skmpm.contact.point_to_curve, self.case.scheme.theta
        if not (outlined and theta == 1.0 and self.scene.walls and new.contacts.force.size):
            return
        index, slip = slip_on_walls(self.scene, old, new)
        f_n, f_t = new.contacts.force[:, index]
        mu = np.array([w.friction for w in self.scene.walls])[-1 - new.contacts.bodies[1, index]]
        loaded = f_n > 1e-3 * max(float(np.abs(new.contacts.force[0]).max()), 1e-300)
        sticks = loaded & (np.abs(f_t) < (1.0 - 1e-3) * mu * f_n)
        along = loaded & (np.abs(f_t) > 1e-3 * mu * f_n)
        slid, drawn = np.abs(slip[sticks]), (np.sign(f_t) * slip)[along]
        h = self.scene.cell
        self._limit("slip", float(slid.max(initial=0.0)) / h, SLIP, new, "sticks and slides [cells]")
        self._limit("drag", float(drawn.max(initial=0.0)) / h, SLIP, new, "friction drives [cells]")

    def _sunk(self, old: skmpm.State, new: skmpm.State) -> None:
        """Boundary points stay in front of walls, unless a support moves them or they were behind before."""
        if not (self.case.scheme.contact is skmpm.contact.point_to_curve and self.case.scheme.theta == 1.0):
            return
        before, after = (behind_walls(self.scene, state) / self.scene.cell for state in (old, new))
        deeper = np.where(after > np.maximum(before, 0.0), after, 0.0)
        self._limit("sunk", float(deeper.max(initial=0.0)), SUNK, new, "sinks into a wall [cells]")

    def _prescribed(self, old: skmpm.State, new: skmpm.State) -> None:
        """Supports move as prescribed; a quasi-static step leads to an equilibrium nearby."""
        if self.scene.supports:
            missed = supports_missed(self.scene, old, new) / self.scene.cell
            self._limit("support", missed, MISSED, new, "a support moves otherwise than prescribed [cells]")
        if not self.case.scheme.inertia:
            self._limit("travel", travel(self.scene, old, new), TRAVEL, new, "thrown away by a quasi-static step")

    def _places(self, state: skmpm.State) -> None:
        """Bodies do not share area nor fold, points are in front of the walls, and of other parts of their body."""
        for wall, point in zip(self.scene.walls, state.walls, strict=True):
            depth = -float((np.asarray(wall.normal) @ (state.x - point[:, None])).min()) / self.scene.cell
            if self.case.scheme.contact is skmpm.contact.point_to_curve:
                self._limit("behind a wall", depth, BEHIND, state, "points behind a wall [cells]")
        self._limit("overlap", state.report.overlap, OVERLAP, state, "bodies overlap")
        if self.stack:  # in the others bodies that are crushed still fold: test_parameters.py
            loops = [loops_of(self.scene, state, b) for b in range(len(self.scene.bodies))]
            crossed = [crossings(own, FOLD * self.scene.cell) for own in loops]
            self._limit("crossings", float(max(crossed)), 0.5, state, f"body {np.argmax(crossed)} crosses itself")
            depth = (
                max(deepest_in_itself(own) for own in loops if crossings(own)) if any(map(crossings, loops)) else 0.0
            )
            self._limit("depth in itself", depth / self.scene.cell, DEPTH, state, "a body passes through itself")
        if len(self.scene.bodies) <= MANY:
            share = shared_points(self.scene, state)
            if share > OVERLAP:  # few and large points count for more than what they share
                share = shared_area(self.scene, state)
            self._limit("inner points in other bodies", share, OVERLAP, state, "points lie in other bodies")
            if self.case.scheme.contact is skmpm.contact.point_to_curve:
                depth = deepest(self.scene, state) / self.scene.cell
                limit = DEPTH if self.stack else DEPTH_COARSE
                self._limit("depth", depth, limit, state, "a boundary point lies in another body [cells]")


def determinant(F: np.ndarray) -> np.ndarray:
    """Of (2, 2, n)."""
    return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]


def beyond_log(J: np.ndarray) -> np.ndarray:
    """J - 1 - ln J, to full accuracy near 1."""
    e = J - 1.0
    series = e**2 * (1 / 2 - e * (1 / 3 - e * (1 / 4 - e * (1 / 5 - e / 6))))
    return np.where(np.abs(e) < 1e-3, series, e - np.log1p(e))
