"""What every state of every run must obey, checked by code that did not produce the numbers.

Nothing here calls the library but to run it: momentum and energies come from the points, contact laws from the list
of contacts, overlaps from points in polygons.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field

import numpy as np
from scenes import Case

import skmpm

MOMENTUM = 1e-10  # of sum m |v| + dt sum |forces|, per step
ENERGY = 1e-6  # of the largest of all energies so far: Newton's tolerance; what a run may gain, in all
CONE = 1e-9  # of friction f_n, and of the largest force
OPEN = 1e-3  # [cells] gap of a contact that carries force
BEHIND = 0.05  # [cells] points behind walls
OVERLAP = 0.01  # of the bodies' area
MANY = 40  # bodies up to which points are looked for in polygons
REMEDY = re.compile(
    r"\b(smaller|larger|use|lower|raise|add|give|move|let|finer|coarser|fewer|more|try)\b", re.IGNORECASE
)


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
        if J.min() <= 0.0:
            return
        self._momentum(old, new)
        self._energy(old, new, J)
        self._contacts(new)
        self._places(new)

    def finish(self) -> None:
        """After the last step: that it was the last."""
        if abs(self.state.t - self.case.until) > 1e-9 * self.case.until:
            self.found["end"] = f"ended at {self.state.t:.6g} s instead of {self.case.until:.6g} s"

    def failed(self, error: skmpm.StepFailed) -> None:
        """What a failure must tell, and that the last good state is one."""
        if "t = " not in str(error):
            self.found["message"] = "the failure does not name its time"
        if not REMEDY.search(str(error)):
            self.found["message"] = "the failure names no remedy"
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
        numbers = (energy.kinetic, energy.elastic, energy.external, energy.push_out, energy.relaid, energy.dissipated)
        if all(np.isfinite(a).all() for a in arrays) and np.isfinite(numbers).all():
            return True
        self.found.setdefault("finite", f"not finite at t = {state.t:.6g} s, step {self.steps}")
        return False

    def _momentum(self, old: skmpm.State, new: skmpm.State) -> None:
        """Change of momentum against gravity, walls and supports, over sum m |v| + dt sum |forces|."""
        dt, m = new.t - old.t, new.mass
        weight = m.sum() * np.asarray(self.scene.gravity)
        given = dt * (weight - new.wall_force.sum(axis=0) - new.support_force.sum(axis=0))
        size = float((m * np.abs(old.v)).sum() + (m * np.abs(new.v)).sum())
        size += dt * float(np.abs(weight).sum() + np.abs(cartesian(new.contacts)).sum())
        gained = (new.v - old.v) @ m
        # The duration of a step is only known to the rounding of the times it lies between.
        rounding = 4.0 * np.finfo(float).eps * new.t / dt * float(np.abs(given).max())
        error = max(float(np.abs(gained - given).max()) - rounding, 0.0)
        self._limit("momentum", error / max(size, 1e-300), MOMENTUM, new, "momentum not balanced")
        if self.scene.walls:
            self.impulse = self.impulse + dt * new.wall_force[min(1, len(self.scene.walls) - 1)]

    def _energy(self, old: skmpm.State, new: skmpm.State, J: np.ndarray) -> None:
        """Energies of the points, which are at most those of the nodes, against the work of walls and gravity."""
        dt, m, energy = new.t - old.t, new.mass, new.report.energy
        walls = self.scene.wall_velocities(0.5 * (old.t + new.t))
        self.external -= dt * float((walls * new.wall_force).sum())
        self.external += float(np.asarray(self.scene.gravity) @ ((new.x - old.x) @ m))
        # Far from the origin positions are rounded, at every step: so much work of gravity is not seen in them.
        far = np.finfo(float).eps * np.abs(new.x).max(axis=1)
        self.rounded += float(np.abs(self.scene.gravity) @ far * m.sum())
        kinetic = 0.5 * float(m @ (new.v**2).sum(axis=0))
        elastic, rounding = energy.elastic, 0.0
        if not self.case.scheme.mean_dilatation:
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
        allowed = self.start + self.external + self.rounded + energy.push_out + energy.relaid + rounding
        scale = max(self.largest, 1e-300)
        if self.case.scheme.theta == 1.0:  # other rules may gain
            self._limit("energy gained", (kinetic + elastic - allowed) / scale, ENERGY, new, "energy gained")
            fell = old.report.energy.dissipated - energy.dissipated
            self._limit("dissipation undone", fell / scale, ENERGY, new, "dissipated energy came back")
        missing = max(abs(energy.external - self.external) - self.rounded, 0.0)
        self._limit("external", missing / scale, ENERGY, new, "external work is not")
        self.worst["push-out"] = max(self.worst.get("push-out", 0.0), energy.push_out / scale)

    def _elastic(self, state: skmpm.State, J: np.ndarray) -> tuple[float, float]:
        """Of neo-Hookean points, W = mu/2 (F:F - 2 - 2 ln J) + lam/2 (ln J)^2; and what rounding of F makes of it."""
        E, nu = (np.array([getattr(b.material, name) for b in self.scene.bodies]) for name in ("E", "nu"))
        mu, lam = (E / (2 * (1 + nu)))[state.body], (E * nu / ((1 + nu) * (1 - 2 * nu)))[state.body]
        # F:F - 2 - 2 ln J without the cancellation: F:F - 2 J = (F11 - F22)^2 + (F12 + F21)^2.
        F = state.F
        shear = (F[0, 0] - F[1, 1]) ** 2 + (F[0, 1] + F[1, 0]) ** 2
        W = 0.5 * mu * (shear + 2.0 * beyond_log(J)) + 0.5 * lam * np.log1p(J - 1.0) ** 2
        volume = state.weight / J
        # Strains are known to about 10 eps: alone that holds `least`, next to the true strain twice the product.
        elastic = float(volume @ W)
        least = float(volume @ (2.0 * mu + np.abs(lam))) * (10.0 * float(np.finfo(float).eps)) ** 2
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
        if self.case.scheme.contact is skmpm.contact.outlines:
            loaded = f_n > 1e-3 * largest
            self._limit("loaded gap", float(contacts.gap[loaded].max(initial=0.0)) / h, OPEN, state, "force at a gap")

    def _places(self, state: skmpm.State) -> None:
        """Bodies do not share area, points are in front of the walls."""
        for wall, point in zip(self.scene.walls, state.walls, strict=True):
            depth = -float((np.asarray(wall.normal) @ (state.x - point[:, None])).min()) / self.scene.cell
            if self.case.scheme.contact is skmpm.contact.outlines:
                self._limit("behind a wall", depth, BEHIND, state, "points behind a wall [cells]")
        self._limit("overlap", state.report.overlap, OVERLAP, state, "bodies overlap")
        if len(self.scene.bodies) <= MANY:
            share = shared_points(self.scene, state)
            if share > OVERLAP:  # few and large points count for more than what they share
                share = shared_area(self.scene, state)
            self._limit("inner points in other bodies", share, OVERLAP, state, "points lie in other bodies")


def determinant(F: np.ndarray) -> np.ndarray:
    """Of (2, 2, n)."""
    return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]


def beyond_log(J: np.ndarray) -> np.ndarray:
    """J - 1 - ln J, to full accuracy near 1."""
    e = J - 1.0
    series = e**2 * (1 / 2 - e * (1 / 3 - e * (1 / 4 - e * (1 / 5 - e / 6))))
    return np.where(np.abs(e) < 1e-3, series, e - np.log1p(e))


def cartesian(contacts) -> np.ndarray:
    """Forces (2, k) on the first bodies, in x and y."""
    tangent = np.stack([-contacts.normal[1], contacts.normal[0]])
    return contacts.force[0] * contacts.normal + contacts.force[1] * tangent


def shared_points(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Area of the points that lie inside the outline of another body, over that of all; rims touch by nature."""
    shared, offsets = 0.0, scene.offsets
    on_rim = np.zeros(state.body.size, dtype=bool)
    on_rim[scene.outlines.point] = True
    for b, body in enumerate(scene.bodies):
        other = (state.body != b) & ~on_rim
        if not other.any():
            continue
        for loop in body.points.outline:
            polygon = state.x[:, offsets[b] + loop]
            near = other & (state.x > polygon.min(axis=1)[:, None]).all(axis=0)
            near &= (state.x < polygon.max(axis=1)[:, None]).all(axis=0)
            where = np.flatnonzero(near)
            if where.size:
                shared += float(state.weight[where[inside(polygon, state.x[:, where])]].sum())
    return shared / float(state.weight.sum())


def shared_area(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Area inside the outlines (polygons) of two bodies, over that of all, counted on a lattice of h/20."""
    fine, shared, offsets = scene.cell / 20.0, 0.0, scene.offsets
    polygons = [state.x[:, offsets[b] + body.points.outline[0]] for b, body in enumerate(scene.bodies)]
    for a, one in enumerate(polygons):
        for other in polygons[a + 1 :]:
            low = np.maximum(one.min(axis=1), other.min(axis=1))
            high = np.minimum(one.max(axis=1), other.max(axis=1))
            if (low < high).all():
                axes = (np.arange(i + 0.5 * fine, j, fine) for i, j in zip(low, high, strict=True))
                x = np.stack(np.meshgrid(*axes)).reshape(2, -1)
                x = x[:, inside(one, x)]
                shared += float(inside(other, x).sum()) * fine**2
    return shared / float(state.weight.sum())


def inside(polygon: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Whether points x (2, n) lie inside a polygon (2, m): parity of the edges that a ray to the right crosses."""
    a, b = polygon[:, :, None], np.roll(polygon, -1, axis=1)[:, :, None]
    crosses = (a[1] > x[1]) != (b[1] > x[1])
    side = (x[0] - a[0]) * (b[1] - a[1]) - (x[1] - a[1]) * (b[0] - a[0])
    left = np.where(b[1] > a[1], side < 0.0, side > 0.0)
    return (crosses & left).sum(axis=0) % 2 == 1


def ends(case: Case, state: skmpm.State, impulse: np.ndarray) -> dict[str, float]:
    """What users publish, without dimension: speeds over the closing speed, the lid's impulse over E R^2 / c."""
    d = case.dials
    c = d.closing * d.speed
    m, body = state.mass, state.body
    total = np.bincount(body, m)
    v = np.stack([np.bincount(body, m * component) for component in state.v]) / total
    turn = np.bincount(body, m * rotation_rate(state)) / total
    if case.name in ("squeeze", "crush"):
        found = {"impulse": float(np.linalg.norm(impulse)) * d.speed / (d.stress * d.length**2)}
        points = case.dials.shape == "point"
        return found if points else found | {"elongation": float(elongation(state).mean()) - 1.0}
    values = {"velocity x": v[0, 0], "velocity y": v[1, 0], "spin": turn[0] * d.length}
    if len(total) > 1 and case.name == "collision":
        values |= {"velocity x of 2": v[0, 1], "velocity y of 2": v[1, 1], "spin of 2": turn[1] * d.length}
    return {name: float(value / c) for name, value in values.items()}


def rotation_rate(state: skmpm.State) -> np.ndarray:
    """Of the points, (n,) [1/s]: the skew part of C F_rel^-1, as C is by positions at the anchor."""
    F, A = np.moveaxis(state.F, -1, 0), np.moveaxis(state.F_anchor, -1, 0)
    L = np.moveaxis(state.C, -1, 0) @ A @ np.linalg.inv(F)
    return 0.5 * (L[:, 1, 0] - L[:, 0, 1])


def elongation(state: skmpm.State) -> np.ndarray:
    """Ratio of the principal radii of gyration of every body, (bodies,)."""
    w, total = state.volume, np.bincount(state.body, state.volume)
    centre = np.stack([np.bincount(state.body, w * x) for x in state.x]) / total
    d = state.x - centre[:, state.body]
    xx, yy, xy = (np.bincount(state.body, w * a * b) for a, b in ((d[0], d[0]), (d[1], d[1]), (d[0], d[1])))
    half, root = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.sqrt((half + root) / np.maximum(half - root, 1e-300))


def difference(found: dict[str, float], fine: dict[str, float], name: str) -> float:
    """Error against a fine reference: of velocities over the closing speed; of impulse and elongation relative."""
    if not found or set(found) != set(fine):
        return float("nan")
    if name in ("squeeze", "crush"):
        return max(abs(found[k] - fine[k]) / max(abs(fine[k]), 1e-3) for k in fine)
    return max(abs(found[k] - fine[k]) for k in fine)
