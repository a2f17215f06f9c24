"""A body on its background grid, and a contact of two bodies: the figures of docs/theory/method.md."""

import numpy as np
from drawing import arrow, canvas, curves, label, save
from matplotlib.collections import LineCollection, PolyCollection

import skmpm
from skmpm.scheme import Scheme
from skmpm.step.derived import derived_data

H = 1e-3  # side of a cell [m]; pictures are in cells
GEL = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0)
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def draw_body(ink):
    """An ellipse on its background grid."""
    points = skmpm.ellipse((0.1 * H, 0.05 * H), (3.6 * H, 2.4 * H), spacing=0.5 * H, angle=0.35)
    scene = skmpm.Scene([skmpm.Body(points, GEL)], cell=H)
    grid = derived_data(scene, Scheme(), scene.initial_positions, scene.initial_volumes).assembly.grid
    filled, nodes = grid.cell_index, grid.node_index
    (loop,), boundary = curves(scene, scene.initial_positions, H)
    inner = np.setdiff1d(np.arange(scene.owner.size), scene.outlines.point)
    x = scene.initial_positions[:, inner] / H
    low, high = filled.min(axis=1) - 1, filled.max(axis=1) + 2
    left, right, lower, top = low[0], high[0], low[1], high[1]

    axes = canvas(3.9, ((left - 0.1, right + 6.1), (lower - 0.1, top + 0.1)))
    lines = [[(i, lower), (i, top)] for i in range(left, right + 1)]
    lines += [[(left, j), (right, j)] for j in range(lower, top + 1)]
    axes.add_collection(LineCollection(lines, colors=ink.faint, linewidths=0.6, zorder=0.0))
    squares = filled.T[:, None] + CORNERS
    axes.add_collection(
        PolyCollection(squares, facecolors=ink.body, edgecolors=ink.muted, linewidths=0.6, zorder=1.0)
    )
    axes.plot(*nodes, "s", color=ink.muted, markersize=2.2, zorder=2.0)
    axes.plot(*x, ".", color=ink.points, markersize=3.4, zorder=3.0)
    axes.plot(*loop, color=ink.edge, linewidth=1.2, zorder=4.0)
    axes.plot(*boundary, "o", color=ink.boundary, markersize=3.2, zorder=5.0)
    named = {
        "background grid, side h": (right, top - 0.5),
        "smooth outline": nearest(loop, (2.6, 1.9)),
        "boundary point": nearest(boundary, (3.4, 1.0)),
        "material point": nearest(x, (2.6, 0.2)),
        "filled cell": (filled[0].max() + 0.8, -0.5),
        "node of a filled cell": nearest(nodes, (4.0, -1.0)),
    }
    for k, (text, at) in enumerate(named.items()):
        label(axes, ink, text, at, (right + 0.4, top - 0.5 - 1.2 * k))
    return axes.figure


def draw_contact(ink):
    """Two discs between plates in equilibrium, where they touch."""
    sizes = {-1.0: (7 * H, 0.62 * H), 1.0: (5 * H, 0.74 * H)}
    bodies = [skmpm.Body(skmpm.disc((0.0, k * R), R, spacing=gap), GEL) for k, (R, gap) in sizes.items()]
    walls = [skmpm.Wall((0, -14 * H), (0, 1)), skmpm.Wall((0, 10 * H), (0, -1), velocity=(0, -1.2 * H))]
    scene = skmpm.Scene(bodies, cell=H, walls=walls, friction=0.5)
    state = skmpm.run(scene, dt=0.1, until=1.0, scheme=Scheme(inertia=False))
    loops, boundary = curves(scene, state.x, H)
    found = state.contacts
    pressed = np.flatnonzero((found.bodies >= 0).all(axis=0) & (found.force[0] > 0.0))
    x, normal, force = found.x[:, pressed] / H, found.normal[:, pressed], found.force[0, pressed]
    middle = x[1].mean()

    axes = canvas(2.95, ((-2.6, 2.6), (middle - 2.2, middle + 2.24)))
    for k, loop in enumerate(loops):
        axes.fill(*loop, facecolor=(ink.other, ink.body)[k], edgecolor=ink.edge, linewidth=1.2, zorder=1.0 + k)
    near = np.hypot(state.x[0], state.x[1] - H * middle) < 4 * H
    for k in range(2):
        inner = np.setdiff1d(np.flatnonzero(near & (scene.owner == k)), scene.outlines.point)
        axes.plot(*state.x[:, inner] / H, ".", color=(ink.boundary, ink.points)[k], markersize=3.4, zorder=3.0)
    axes.plot(*boundary[:, near[scene.outlines.point]], "o", color=ink.boundary, markersize=3.8, zorder=5.0)
    for at, n, size in zip(x.T, normal.T, force / force.max(), strict=True):
        arrow(axes, at, at + 1.3 * size * n, ink.force)
    k, tip = np.argmin(x[0]), np.argmax(force)
    label(axes, ink, "contact point", x[:, k], (-2.4, middle - 0.75), ink.other)
    label(
        axes, ink, "contact force along the normal", x[:, tip] + 1.1 * normal[:, tip], (-2.4, middle - 1.9), ink.other
    )
    upper = nearest(boundary[:, scene.owner[scene.outlines.point] == 1], (-1.55, middle + 0.2))
    foot = nearest(loops[0], upper)
    axes.plot(*np.stack([upper, foot], axis=1), color=ink.force, linewidth=1.6, zorder=4.5)
    label(axes, ink, "gap", 0.5 * (upper + foot), (-2.4, middle + 0.95), ink.body)
    label(axes, ink, "body 1", (1.75, middle + 1.6), (1.5, middle + 1.6), ink.body)
    label(axes, ink, "body 0", (1.75, middle - 1.3), (1.5, middle - 1.3), ink.other)
    return axes.figure


def nearest(x, place):
    """The one of points (2, n) that is nearest to a place (2,)."""
    return x[:, np.argmin(np.hypot(*(x.T - place).T))]


if __name__ == "__main__":
    save("method_body", draw_body)
    save("method_contact", draw_contact)
