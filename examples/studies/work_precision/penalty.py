"""Competitor of skmpm: discs of finite elements in explicit steps with penalty contact; no mechanics is shared.

Total Lagrangian bilinear quadrilaterals with one quadrature point, which do not lock, and elastic hourglass control
by the bending stiffness of an element (Belytschko & Bindeman, Comput. Methods Appl. Mech. Eng. 88 (1991) 311). Masses
are lumped, steps central differences. In contact boundary nodes push segments, both ways; a spring along the tangent
slides by Coulomb's law (Cundall & Strack, Geotechnique 29 (1979) 47).

All discs have one mesh, scaled, so the loop over elements does `LANES` discs at a time (SIMD). Nodal arrays are
(blocks, nodes, 2, LANES), arrays of boundary nodes (discs, boundary nodes, ...).
"""

from __future__ import annotations

from functools import cache
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
LANES = 8
SLOTS = 4  # discs that a boundary node can be near
MARGIN = 0.15  # within which they are looked for [mean radius]


class Mesh(NamedTuple):
    """A unit disc: nodes (n, 2), elements (e, 4) and boundary nodes, counterclockwise; constants of elements."""

    nodes: Array
    elements: Integers
    rim: Integers
    b: Array  # area times gradients of the shape functions of the first two nodes, (e, 4); of the others minus these
    gamma: Array  # of the hourglass mode, (e, 4)
    area: Array  # (e,)
    mass: Array  # area of nodes, (n,)


class Law(NamedTuple):
    """Stiffnesses [Pa] of elements, of hourglass modes and of a node in contact; coefficient of friction."""

    lam: float
    mu: float
    hourglass: float
    contact: float
    friction: float


class Contact(NamedTuple):
    """Of boundary nodes: where they are, velocity, force; discs nearby, their segments, springs, those of walls."""

    x: Array
    v: Array
    force: Array
    partner: Integers
    segment: Integers
    spring: Array
    wall_spring: Array


@cache
def disc_mesh(m: int) -> Mesh:
    """A square of m x m elements in m / 3 rings of 4 m; its area is that of the disc, so nodes are a bit outside."""
    line, rings = np.linspace(-1.0, 1.0, m + 1), max(1, m // 3)
    u, v = (w.ravel() for w in np.meshgrid(line, line))
    core = 0.55 * np.stack([u * np.sqrt(1.0 - 0.15 * v**2), v * np.sqrt(1.0 - 0.15 * u**2)], axis=1)
    ids = np.arange((m + 1) ** 2).reshape(m + 1, m + 1)
    elements = [np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=-1).reshape(-1, 4)]
    first = inner = np.concatenate([ids[:-1, -1], ids[-1, :0:-1], ids[:0:-1, 0], ids[0, :-1]])
    angle = 0.5 * np.pi * (np.arange(4 * m) / m - 0.5)
    circle, nodes = np.stack([np.cos(angle), np.sin(angle)], axis=1), [core]
    for ring in range(rings):
        outer, share = ids.size + 4 * m * ring + np.arange(4 * m), (ring + 1.0) / rings
        nodes.append((1.0 - share) * core[first] + share * circle)
        elements.append(np.stack([inner, outer, np.roll(outer, -1), np.roll(inner, -1)], axis=1))
        inner = outer
    x, e = np.concatenate(nodes) * np.sqrt(0.5 * np.pi / (m * np.sin(0.5 * np.pi / m))), np.concatenate(elements)
    at = x[e]
    (dx, dy), (ex, ey) = (at[:, 2] - at[:, 0]).T, (at[:, 3] - at[:, 1]).T
    b, area = 0.5 * np.stack([-ey, ex, dy, -dx], axis=1), 0.5 * (dx * ey - ex * dy)
    mode = np.array([1.0, -1.0, 1.0, -1.0])
    gradient = np.concatenate([b, -b], axis=1).reshape(-1, 4, 2) / area[:, None, None]
    gamma = 0.25 * (mode - np.einsum("a,eai,ebi->eb", mode, at, gradient))
    return Mesh(x, e, inner, b, gamma, area, np.bincount(e.ravel(), np.repeat(0.25 * area, 4)))


@cache
def frequency(m: int, law: Law) -> float:
    """The largest angular frequency of a unit disc of unit density [1/s]."""
    mesh, eye = disc_mesh(m), np.eye(2)
    gradient = np.concatenate([mesh.b, -mesh.b], axis=1).reshape(-1, 4, 2) / mesh.area[:, None, None]
    K = law.lam * np.einsum("eai,ebj->eaibj", gradient, gradient)
    K += law.mu * np.einsum("eaj,ebi->eaibj", gradient, gradient)
    K += law.mu * np.einsum("eak,ebk,ij->eaibj", gradient, gradient, eye)
    K *= mesh.area[:, None, None, None, None]
    K += law.hourglass * np.einsum("ea,eb,ij->eaibj", mesh.gamma, mesh.gamma, eye)
    dofs = (2 * mesh.elements[:, :, None] + np.arange(2)).reshape(-1, 8)
    root = 1.0 / np.sqrt(np.repeat(mesh.mass, 2))
    whole = np.zeros((root.size, root.size))
    np.add.at(whole, (dofs[:, :, None], dofs[:, None, :]), K.reshape(-1, 8, 8))
    return float(np.sqrt(np.linalg.eigvalsh(root[:, None] * whole * root)[-1]))


@compiled
def _internal(mesh: Mesh, law: Law, radius: Array, x: Array, f: Array) -> None:
    """Write the forces of elements on nodes [N/m]; ln J is a series in (J - 1) / (J + 1), to 1e-6 for 1/2 < J < 2."""
    u, g, n = np.empty(8 * LANES), np.empty(8 * LANES), LANES
    lam, mu, hourglass = law.lam, law.mu, law.hourglass
    for block in range(x.shape[0]):
        f[block] = 0.0
        r = radius[block]
        for e in range(mesh.elements.shape[0]):
            for a in range(4):
                node = mesh.elements[e, a]
                for k in range(LANES):
                    u[2 * a * n + k], u[(2 * a + 1) * n + k] = x[block, node, 0, k], x[block, node, 1, k]
            ax, ay, bx, by, area = mesh.b[e, 0], mesh.b[e, 1], mesh.b[e, 2], mesh.b[e, 3], mesh.area[e]
            g0, g1, g2, g3 = mesh.gamma[e, 0], mesh.gamma[e, 1], mesh.gamma[e, 2], mesh.gamma[e, 3]
            for k in range(LANES):
                x0, y0, x1, y1 = u[k], u[n + k], u[2 * n + k], u[3 * n + k]
                x2, y2, x3, y3 = u[4 * n + k], u[5 * n + k], u[6 * n + k], u[7 * n + k]
                s = 1.0 / (area * r[k])
                xx, xy = s * ((x0 - x2) * ax + (x1 - x3) * bx), s * ((x0 - x2) * ay + (x1 - x3) * by)  # F
                yx, yy = s * ((y0 - y2) * ax + (y1 - y3) * bx), s * ((y0 - y2) * ay + (y1 - y3) * by)
                J = xx * yy - xy * yx
                z = (J - 1.0) / (J + 1.0)
                w = z * z
                log = 2.0 * z * (1.0 + w * (1.0 / 3.0 + w * (0.2 + w * (1.0 / 7.0 + w / 9.0))))
                slope = (lam * log - mu) / J
                pxx, pxy = r[k] * (mu * xx + slope * yy), r[k] * (mu * xy - slope * yx)
                pyx, pyy = r[k] * (mu * yx - slope * xy), r[k] * (mu * yy + slope * xx)
                hx = hourglass * (g0 * x0 + g1 * x1 + g2 * x2 + g3 * x3)
                hy = hourglass * (g0 * y0 + g1 * y1 + g2 * y2 + g3 * y3)
                px, py, qx, qy = pxx * ax + pxy * ay, pyx * ax + pyy * ay, pxx * bx + pxy * by, pyx * bx + pyy * by
                g[k], g[n + k] = -px - hx * g0, -py - hy * g0
                g[2 * n + k], g[3 * n + k] = -qx - hx * g1, -qy - hy * g1
                g[4 * n + k], g[5 * n + k] = px - hx * g2, py - hy * g2
                g[6 * n + k], g[7 * n + k] = qx - hx * g3, qy - hy * g3
            for a in range(4):
                node = mesh.elements[e, a]
                for k in range(LANES):
                    f[block, node, 0, k] += g[2 * a * n + k]
                    f[block, node, 1, k] += g[(2 * a + 1) * n + k]


@compiled
def _search(near: Contact, margin: float) -> None:
    """Find the discs, and their nearest nodes, that boundary nodes are near; springs are kept."""
    x, n, m = near.x, near.x.shape[0], near.x.shape[1]
    centre, reach = np.zeros((n, 2)), np.zeros(n)
    for i in range(n):
        for k in range(m):
            centre[i, 0] += x[i, k, 0] / m
            centre[i, 1] += x[i, k, 1] / m
        for k in range(m):
            reach[i] = max(reach[i], np.hypot(x[i, k, 0] - centre[i, 0], x[i, k, 1] - centre[i, 1]))
    before, kept = near.partner.copy(), near.spring.copy()
    near.partner[:], near.spring[:] = -1, 0.0
    for i in range(n):
        for j in range(n):
            apart = np.hypot(centre[i, 0] - centre[j, 0], centre[i, 1] - centre[j, 1])
            if i == j or apart > reach[i] + reach[j] + margin:
                continue
            edge = (x[j, 1, 0] - x[j, 0, 0]) ** 2 + (x[j, 1, 1] - x[j, 0, 1]) ** 2
            for k in range(m):
                px, py = x[i, k, 0], x[i, k, 1]
                if np.hypot(px - centre[j, 0], py - centre[j, 1]) > reach[j] + margin:
                    continue
                nearest, least = 0, 1e300
                for s in range(m):
                    d = (x[j, s, 0] - px) ** 2 + (x[j, s, 1] - py) ** 2
                    if d < least:
                        nearest, least = s, d
                if least > margin**2 + edge:
                    continue
                slot = 0
                while slot < SLOTS - 1 and near.partner[i, k, slot] >= 0:
                    slot += 1
                near.partner[i, k, slot], near.segment[i, k, slot] = j, nearest
                for old in range(SLOTS):
                    if before[i, k, old] == j:
                        near.spring[i, k, slot] = kept[i, k, old]


@compiled
def _contact(near: Contact, law: Law, width: float, top: float, dt: float) -> float:
    """Write the contact forces on boundary nodes [N/m] and return that on the lid, upwards."""
    x, v, force, n, m, lid = near.x, near.v, near.force, near.x.shape[0], near.x.shape[1], 0.0
    force[:] = 0.0
    for i in range(n):
        for k in range(m):
            px, py = x[i, k, 0], x[i, k, 1]
            for slot in range(SLOTS):
                j = near.partner[i, k, slot]
                if j < 0:
                    break
                s, after, xi, ex, ey, square = near.segment[i, k, slot], 0, 0.0, 0.0, 0.0, 1.0
                for _ in range(4):  # along the boundary to the segment that the node is opposite to
                    after = s + 1 if s + 1 < m else 0
                    ex, ey = x[j, after, 0] - x[j, s, 0], x[j, after, 1] - x[j, s, 1]
                    square = ex * ex + ey * ey
                    xi = ((px - x[j, s, 0]) * ex + (py - x[j, s, 1]) * ey) / square
                    near.segment[i, k, slot] = s
                    if xi < 0.0:
                        s = s - 1 if s > 0 else m - 1
                    elif xi > 1.0:
                        s = after
                    else:
                        break
                s = near.segment[i, k, slot]
                xi, length = min(max(xi, 0.0), 1.0), np.sqrt(square)
                tx, ty = ex / length, ey / length
                gap = (px - x[j, s, 0]) * ty - (py - x[j, s, 1]) * tx
                if gap >= 0.0:
                    near.spring[i, k, slot] = 0.0
                    continue
                vx = v[i, k, 0] - (1.0 - xi) * v[j, s, 0] - xi * v[j, after, 0]
                vy = v[i, k, 1] - (1.0 - xi) * v[j, s, 1] - xi * v[j, after, 1]
                stretch = near.spring[i, k, slot] + dt * (vx * tx + vy * ty)
                stretch = min(max(stretch, law.friction * gap), -law.friction * gap)
                near.spring[i, k, slot] = stretch
                fx, fy = -law.contact * (gap * ty + stretch * tx), law.contact * (gap * tx - stretch * ty)
                for axis, f in ((0, fx), (1, fy)):
                    force[i, k, axis] += f
                    force[j, s, axis] -= (1.0 - xi) * f
                    force[j, after, axis] -= xi * f
            for wall in range(4):  # left, floor, right, lid
                axis = wall % 2
                sign = 1.0 if wall < 2 else -1.0
                gap = x[i, k, axis] if wall < 2 else (width if wall == 2 else top) - x[i, k, axis]
                if gap >= 0.0:
                    near.wall_spring[i, k, wall] = 0.0
                    continue
                stretch = near.wall_spring[i, k, wall] + dt * v[i, k, 1 - axis]
                stretch = min(max(stretch, law.friction * gap), -law.friction * gap)
                near.wall_spring[i, k, wall] = stretch
                force[i, k, axis] -= sign * law.contact * gap
                force[i, k, 1 - axis] -= law.contact * stretch
                if wall == 3:
                    lid -= law.contact * gap
    return lid


@compiled
def _march(mesh: Mesh, law: Law, near: Contact, radius: Array, mass: Array, x: Array, v: Array, f: Array,
           ahead: Array, steps: int, dt: float, box: tuple[float, float, float], viscosity: float, drag: float,
           margin: float) -> float:  # fmt: skip
    """Steps of central differences; `box` is width, height, speed of the lid; returns the mean force on it [N/m]."""
    lid, moved, top, discs, m = 0.0, 1e300, box[1], near.x.shape[0], near.x.shape[1]
    for _ in range(steps):
        for i in range(discs):
            for k in range(m):
                for axis in range(2):
                    near.x[i, k, axis] = x[i // LANES, mesh.rim[k], axis, i % LANES]
                    near.v[i, k, axis] = v[i // LANES, mesh.rim[k], axis, i % LANES]
        if 2.0 * moved > margin:
            _search(near, margin)
            moved = 0.0
        top -= dt * box[2]
        lid += _contact(near, law, box[0], top, dt)
        _internal(mesh, law, radius, ahead, f)
        for i in range(discs):
            for k in range(m):
                for axis in range(2):
                    f[i // LANES, mesh.rim[k], axis, i % LANES] += near.force[i, k, axis]
        fastest = 0.0
        for block in range(x.shape[0]):
            for node in range(x.shape[1]):
                for axis in range(2):
                    for k in range(LANES):
                        w = drag * v[block, node, axis, k] + dt * f[block, node, axis, k] / mass[block, node, k]
                        v[block, node, axis, k] = w
                        x[block, node, axis, k] += dt * w
                        ahead[block, node, axis, k] = x[block, node, axis, k] + viscosity * w
                        fastest = max(fastest, w * w)
        moved += dt * np.sqrt(2.0 * fastest)
    return lid / steps


class Discs:
    """Discs in a box under a lid.

    Parameters
    ----------
    centres, radii : (2, n), (n,) [m]
    material : with `lame` [Pa] and `density` [kg/m3]; its law is taken to be that of `skmpm.NeoHookean`
    box : width and height [m]
    friction : coefficient, also of the walls
    mesh : elements along a side of the square inside a disc
    penalty : stiffness of a node in contact [lambda + 2 mu]
    courant : length of steps [that of stability at small strain with three contacts at each boundary node]
    damping : stiffness-proportional [steps]
    """

    def __init__(self, centres: Array, radii: Array, material: Any, box: tuple[float, float], friction: float, *,
                 mesh: int, penalty: float, courant: float = 0.9, damping: float = 0.1) -> None:  # fmt: skip
        (lam, mu), self.mesh, self.radii = material.lame, disc_mesh(mesh), radii
        self.width, self.top, n, m = *box, radii.size, self.mesh.rim.size
        bending = 8.0 / 3.0 * mu * 2.0 * (lam + mu) / (lam + 2.0 * mu)
        self.law = Law(lam, mu, bending, penalty * (lam + 2.0 * mu), friction)
        springs = 3.0 * self.law.contact / self.mesh.mass[self.mesh.rim].min()
        fastest = np.sqrt((frequency(mesh, self.law) ** 2 + springs) / material.density) / radii.min()
        self.dt = float(2.0 * courant / fastest)
        self.viscosity, blocks = damping * self.dt, -(-n // LANES)
        r, middle = np.full(blocks * LANES, radii.mean()), np.zeros((2, blocks * LANES))
        r[:n], middle[:, :n] = radii, centres
        self.radius = r.reshape(blocks, LANES)
        shift = middle.reshape(2, blocks, LANES).transpose(1, 0, 2)[:, None]
        self.x = np.ascontiguousarray(self.mesh.nodes[:, :, None] * self.radius[:, None, None] + shift)
        self.v, self.f, self.ahead = np.zeros_like(self.x), np.zeros_like(self.x), self.x.copy()
        self.mass = material.density * self.mesh.mass[:, None] * self.radius[:, None] ** 2
        at, v, force, spring, walls = (np.zeros((n, m, k)) for k in (2, 2, 2, SLOTS, 4))
        slots = (n, m, SLOTS)
        self.near = Contact(at, v, force, np.full(slots, -1), np.zeros(slots, dtype=np.int64), spring, walls)
        self.seconds, self.steps = 0.0, 0

    def advance(self, steps: int, lid_speed: float = 0.0, drag: float = 0.0) -> float:
        """So many steps, the lid coming down [m/s], with a drag [1/s]; returns the mean force on it [N/m]."""
        box, margin, began = (self.width, self.top, lid_speed), MARGIN * float(self.radii.mean()), process_time()
        fields = self.radius, self.mass, self.x, self.v, self.f, self.ahead
        numbers = steps, self.dt, box, self.viscosity, 1.0 - drag * self.dt, margin
        lid = _march(self.mesh, self.law, self.near, *fields, *numbers)
        self.seconds, self.steps = self.seconds + process_time() - began, self.steps + steps
        self.top -= steps * self.dt * lid_speed
        return float(lid)

    def by_disc(self, nodal: Array) -> Array:
        """Positions or velocities, (discs, nodes, 2)."""
        return nodal.transpose(0, 3, 1, 2).reshape(-1, nodal.shape[1], 2)[: self.radii.size]

    def from_centres(self) -> Array:
        """Positions relative to the centre of mass, (discs, nodes, 2) [m]."""
        x = self.by_disc(self.x)
        return x - (self.mesh.mass @ x)[:, None] / self.mesh.mass.sum()

    def virial(self) -> float:
        """Pressure of the contact forces (Love and Weber) times the area of the packing [N]."""
        return -0.5 * float((self.near.force * self.from_centres()[:, self.mesh.rim]).sum())

    def aspect_ratio(self) -> float:
        """Mean over the discs of the extent along the long axis of second moments over that across."""
        d = self.from_centres()
        xx, xy, yy = (d[:, :, i] * d[:, :, j] @ self.mesh.mass for i, j in ((0, 0), (0, 1), (1, 1)))
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)[:, None]
        along, across = (np.cos(t) * d[..., 0] + np.sin(t) * d[..., 1] for t in (angle, angle + 0.5 * np.pi))
        return float(np.mean(np.ptp(along, axis=1) / np.ptp(across, axis=1)))
