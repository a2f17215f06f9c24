"""How bodies are loaded, a panel for each object: the figures of docs/how_to/loading.md."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from drawing import arrow, bare, save
from matplotlib.collections import PathCollection
from matplotlib.patches import Arc, Rectangle
from matplotlib.transforms import Bbox

import skmpm
from skmpm import outline
from skmpm.outline.images import lattice_vectors
from skmpm.plot.bodies import body_paths

GEL, STEEL = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0), skmpm.Rigid(7800.0)
VIEW = ((-1.5, 1.5), (-1.35, 1.65))  # of a panel
CELL, SPACING = 0.2, 0.1
WALL = 0.12  # thickness of walls in pictures


def draw_scenes(ink):
    """Walls, a rigid body and a periodic box that move or press."""
    figure, axes = panels()
    for each, ax in zip((moving_lid, pressed_lid, drum, periodic_box), axes, strict=True):
        each(ax, ink)
    return figure


def draw_bodies(ink):
    """What acts on parts of bodies."""
    figure, axes = panels()
    for each, ax in zip((load, pressure, support, springs), axes, strict=True):
        each(ax, ink)
    return figure


def moving_lid(axes, ink):
    """A lid moves down at a given speed."""
    discs, height = packing()
    lid = skmpm.Wall((0.0, 0.5 * height), (0.0, -1.0), velocity=(0.0, -0.1))
    fill(axes, ink, skmpm.Scene(discs, cell=CELL, walls=[lid]))
    box(axes, ink, height)
    arrow(axes, (0.0, 0.5 * height + 0.6), (0.0, 0.5 * height + WALL), ink.force, 2.4)
    title(axes, ink, "Wall(velocity=)")


def pressed_lid(axes, ink):
    """A pressure acts on a lid."""
    discs, height = packing()
    lid = skmpm.Wall((0.0, 0.5 * height), (0.0, -1.0), pressure=1e4)
    fill(axes, ink, skmpm.Scene(discs, cell=CELL, walls=[lid]))
    box(axes, ink, height)
    for x in np.linspace(-0.85, 0.85, 7):
        arrow(axes, (x, 0.5 * height + 0.5), (x, 0.5 * height + WALL), ink.force)
    title(axes, ink, "Wall(pressure=)")


def drum(axes, ink):
    """A rigid ring turns with the bodies in it."""
    shell = skmpm.Body(skmpm.ring((0.0, 0.0), 1.02, 1.2, spacing=SPACING), STEEL, motion=(0.0, 0.0, 1.0))
    places = [(-0.5, -0.6), (0.05, -0.76), (0.55, -0.48), (-0.2, -0.2), (0.34, 0.0)]
    radii = [0.23, 0.22, 0.24, 0.22, 0.2]
    discs = [skmpm.Body(skmpm.disc(x, r, spacing=SPACING), GEL) for x, r in zip(places, radii, strict=True)]
    fill(axes, ink, skmpm.Scene([shell, *discs], cell=CELL))
    turning(axes, ink, (0.0, 0.0), 0.8, 50.0, 130.0)
    title(axes, ink, "Body(..., motion=)")


def periodic_box(axes, ink):
    """A periodic box shrinks; images of the bodies are around it."""
    discs, height = packing(periodic=True)
    scene = skmpm.Scene(discs, cell=CELL, periodic=skmpm.Periodic(2.0, height, rate=[[-0.1, 0.0], [0.0, -0.1]]))
    for shift in lattice_vectors(np.ones(2, dtype=np.int64)).T:
        fill(axes, ink, scene, shift * (2.0, height), alpha=0.25)
    fill(axes, ink, scene)
    edge = {"fill": False, "edgecolor": ink.text, "linestyle": "--", "linewidth": 1.2, "zorder": 6.0}
    axes.add_patch(Rectangle((-1.0, -0.5 * height), 2.0, height, **edge))
    for x, y in ((1.0, 0.0), (-1.0, 0.0), (0.0, 0.5 * height), (0.0, -0.5 * height)):
        outward = np.sign((x, y))
        arrow(axes, (x, y) + 0.42 * outward, (x, y) + 0.02 * outward, ink.force, 2.4)
    title(axes, ink, "Periodic(rate=, stress=)")


def load(axes, ink):
    """A force acts on a part of a block."""
    block = skmpm.Body(skmpm.box((-1.0, -0.8), (2.0, 1.3), spacing=SPACING), GEL)
    top = skmpm.Load(lambda x: (x[1] > 0.49) & (abs(x[0]) < 0.45), (0.0, -100.0))
    scene = skmpm.Scene([block], cell=CELL, loads=[top])
    fill(axes, ink, scene)
    ground(axes, ink, -0.8)
    chosen = marked(axes, ink, scene, top.where)
    for x, y in chosen.T[::2]:
        arrow(axes, (x, y + 0.5), (x, y + 0.04), ink.force)
    title(axes, ink, "Load(where, (fx, fy))")


def pressure(axes, ink):
    """A pressure acts on all of a boundary."""
    seal = skmpm.Body(skmpm.ring((0.0, 0.0), 0.35, 0.75, spacing=SPACING), GEL)
    around = skmpm.Pressure(lambda x: np.hypot(*x) > 0.7, 1e4)
    scene = skmpm.Scene([seal], cell=CELL, loads=[around])
    fill(axes, ink, scene)
    chosen = marked(axes, ink, scene, around.where)
    for x in chosen.T[::3]:
        n = x / np.hypot(*x)
        arrow(axes, x + 0.42 * n, x + 0.04 * n, ink.force)
    title(axes, ink, "Pressure(where, value)")


def support(axes, ink):
    """One end of a beam is held, the other one turned."""
    beam = skmpm.Body(skmpm.box((-1.1, -0.25), (2.2, 0.5), spacing=SPACING), GEL)
    held = skmpm.Support(lambda x: x[0] < -0.9)
    turned = skmpm.Support(lambda x: x[0] > 0.9, rotation=lambda t: 0.1 * t)
    scene = skmpm.Scene([beam], cell=CELL, supports=[held, turned])
    fill(axes, ink, scene)
    for each in (held, turned):
        marked(axes, ink, scene, each.where)
    axes.plot((-1.1, -1.1), (-0.6, 0.6), color=ink.text, linewidth=2.0)
    turning(axes, ink, (1.0, 0.0), 0.5, 40.0, 150.0)
    title(axes, ink, "Support(where, rotation=)")


def springs(axes, ink):
    """A bar joins two bodies, and one of them rests on an elastic bed."""
    R = 0.42
    discs = [skmpm.Body(skmpm.disc((x, 0.3), R, spacing=SPACING), GEL) for x in (-0.85, 0.85)]
    left, right = (lambda x: x[0] < 0.0), (lambda x: x[0] > 0.0)
    foot = lambda x: (x[0] < 0.0) & (x[1] < -0.06)  # noqa: E731
    bed, bar = skmpm.Spring(foot, 1e5), skmpm.Spring(left, 1e5, to=right)
    scene = skmpm.Scene(discs, cell=CELL, springs=[bed, bar])
    fill(axes, ink, scene)
    coil(axes, ink, (-0.85, 0.3), (0.85, 0.3))
    for x, y in marked(axes, ink, scene, foot).T[::2]:
        coil(axes, ink, (x, y), (x, -0.75), 0.04)
    ground(axes, ink, -0.75, left=-1.35, right=-0.35)
    title(axes, ink, "Spring(where, k, to=)")


def panels():
    """Four panels in a square."""
    figure, axes = plt.subplots(2, 2, figsize=(3.45, 3.45))
    figure.subplots_adjust(0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    for ax in axes.ravel():
        bare(ax, VIEW)
    return figure, axes.ravel()


def title(axes, ink, text):
    """Write a call above a panel."""
    axes.text(0.0, 1.5, text, color=ink.text, ha="center", va="center", family="monospace", size=7.5)


def packing(periodic=False):
    """Nine discs in a box about zero of width 2, and its height."""
    radii = np.random.default_rng(3).uniform(0.2, 0.34, 9)
    found = skmpm.packing(radii, width=2.0, solid_fraction=0.72, seed=1, periodic=periodic)
    centres = found.centres.T - (1.0, 0.5 * found.height)
    discs = [skmpm.disc(x, r, spacing=SPACING) for x, r in zip(centres, found.radii, strict=True)]
    return [skmpm.Body(each, GEL) for each in discs], found.height


def fill(axes, ink, scene, shift=(0.0, 0.0), alpha=1.0):
    """Fill the outlines of bodies, rigid ones grey."""
    place = scene.outlines.point
    line = outline.polylines(scene.outlines, scene.initial_positions[:, place], scene.initial_positions[:, place], 3)
    paths, owner = body_paths(replace(line, x=line.x + np.reshape(shift, (2, 1))))
    seen = [k for k, path in enumerate(paths) if path.intersects_bbox(Bbox(np.transpose(VIEW)), filled=True)]
    faces = [ink.body if scene.deformable[owner[k]] else ink.faint for k in seen]
    drawn = PathCollection(
        [paths[k] for k in seen], facecolors=faces, edgecolors=ink.edge, linewidths=1.0, alpha=alpha
    )
    axes.add_collection(drawn)
    drawn.set_clip_path(Rectangle((-1.4, -1.25), 2.8, 2.6, transform=axes.transData))


def marked(axes, ink, scene, where):
    """Mark the points that `where` chooses, and return those of them on boundaries (2, k), in their order."""
    x = scene.initial_positions
    axes.plot(*x[:, where(x)], "o", color=ink.boundary, markersize=2.6, zorder=4.0)
    on_boundary = x[:, scene.outlines.point]
    return on_boundary[:, where(on_boundary)]


def box(axes, ink, height):
    """A floor, two sides and a lid around a box of width 2."""
    half = 0.5 * height
    for corner, width, tall in (
        ((-1.0 - WALL, -half - WALL), 2.0 + 2.0 * WALL, WALL),
        ((-1.0 - WALL, -half), WALL, height + 0.3),
        ((1.0, -half), WALL, height + 0.3),
        ((-1.0, half), 2.0, WALL),
    ):
        axes.add_patch(Rectangle(corner, width, tall, facecolor=ink.faint, edgecolor="none"))


def ground(axes, ink, y, left=-1.3, right=1.3):
    """A floor."""
    axes.add_patch(Rectangle((left, y - WALL), right - left, WALL, facecolor=ink.faint, edgecolor="none"))


def turning(axes, ink, centre, radius, begin, end):
    """An arc with the tip of an arrow at its end [degrees]."""
    axes.add_patch(Arc(centre, 2.0 * radius, 2.0 * radius, theta1=begin, theta2=end, color=ink.force, linewidth=2.0))
    angles = np.radians((end - 8.0, end + 4.0))
    last = np.array(centre)[:, None] + radius * np.stack([np.cos(angles), np.sin(angles)])
    arrow(axes, last[:, 0], last[:, 1], ink.force, 2.0)


def coil(axes, ink, start, end, width=0.09):
    """A spring from one point to another: a zigzag between two straight ends."""
    start, along = np.array(start), np.subtract(end, start)
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    s = np.concatenate([[0.0], np.linspace(0.2, 0.8, 12), [1.0]])
    side = np.concatenate([[0.0, 0.0], width * np.resize([1.0, -1.0], 10), [0.0, 0.0]])
    x = start[:, None] + along[:, None] * s + across[:, None] * side
    axes.plot(*x, color=ink.force, linewidth=1.2, zorder=5.0)


if __name__ == "__main__":
    save("loading_scenes", draw_scenes)
    save("loading_bodies", draw_bodies)
