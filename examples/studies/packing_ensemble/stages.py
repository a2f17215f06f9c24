"""States kept at four stages: the force network, the identity of stress and contacts, and the shapes of discs."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

import skmpm

from . import scenes, study
from .curves import Member

Array = np.ndarray

FORCED = 1e-9  # forces below this share of the largest are none
MEASURES = "stages.json"  # file beside the table of a member


def scene(member: Member) -> skmpm.Scene:
    """The scene of a member, built anew."""
    return scenes.build(member.options)[0]


def states(member: Member) -> dict[float, skmpm.State]:
    """The states that were kept, by nominal solid fraction."""
    paths = {stage: member.folder / f"{study.name_of(stage)}.checkpoint" for stage in study.STAGES}
    return {stage: skmpm.load(path) for stage, path in paths.items() if path.exists()}


def measured(member: Member) -> dict[float, dict[str, float]]:
    """What the kept states tell, by nominal solid fraction: `identity`, `apart` and `polygons`.

    Written beside the table of a run that has finished, so that it outlasts the states.
    """
    path = member.folder / MEASURES
    if path.exists():
        return {float(stage): values for stage, values in json.loads(path.read_text()).items()}
    kept = states(member)
    if not kept:
        return {}
    bodies = scene(member)
    found = {
        stage: {
            "identity": identity(member, state),
            "apart": apart(bodies, state),
            "polygons": polygons(bodies, state),
        }
        for stage, state in kept.items()
    }
    if member.status == "finished":
        path.write_text(json.dumps(found, indent=1) + "\n")
    return found


@dataclass(frozen=True, eq=False)
class Network:
    """Pairs in contact: two bodies, or a body and a wall, with the sum of their contact forces."""

    pairs: Array  # (2, k) their numbers; walls are negative, and second
    ends: Array  # (2, 2, k) x and y of the centres of both; of a wall, of where it is touched [m]
    branch: Array  # (2, k) from the second centre to the first; for a wall to the centre of its body's mirror image
    force: Array  # (2, k) on the first [N/m]
    share: Array  # (k,) 1 for two bodies, 1/2 for a wall


def network(state: skmpm.State) -> Network:
    """Sum the contact forces of each pair that has any; own code, which `skmpm.observe` has no part in."""
    contacts = state.contacts
    size = np.hypot(*contacts.force)
    some = size > FORCED * size.max(initial=0.0)
    force, x, (first, second) = contacts.vectors[:, some], contacts.x[:, some], contacts.bodies[:, some]
    swap = (first < second) & (first >= 0)  # the larger number first: walls, which are negative, come second
    first, second, force = np.where(swap, second, first), np.where(swap, first, second), np.where(swap, -force, force)
    pairs, of = np.unique(np.stack([first, second]), axis=1, return_inverse=True)
    of, k = of.ravel(), pairs.shape[1]
    total = np.array([np.bincount(of, component, k) for component in force])
    weight = np.hypot(*force)
    touched = np.array([np.bincount(of, weight * c, k) for c in x]) / np.bincount(of, weight, k)
    centre = state.centres
    wall = pairs[1] < 0
    one, other = centre[:, pairs[0]], np.where(wall, touched, centre[:, np.maximum(pairs[1], 0)])
    branch = np.where(wall, 2.0, 1.0) * (one - other)
    return Network(pairs, np.stack([one, other]), branch, total, np.where(wall, 0.5, 1.0))


def identity(member: Member, state: skmpm.State) -> float:
    """(Phi Z / 4) sigma_l over P, sigma_l = <f.l> / <V_p>; Phi, Z and P from the member's table; nan without forces.

    <f.l> is the mean over contacts, one with a wall counting as half a contact with the mirror image; <V_p> the mean
    volume by det F of the points. Phi is that of the outlines, so the two measures of volume are compared as well.
    """
    if not np.hypot(*state.contacts.force).any():
        return np.nan
    at = int(np.argmin(np.abs(member.table["t"] - state.t)))
    phi, Z, P = (member.table[name][at] for name in ("solid_fraction", "coordination", "pressure"))
    seen = network(state)
    work = np.einsum("ik,ik->k", seen.force, seen.branch)
    volume = state.volume.sum() / (state.body.max() + 1)
    return float(phi * Z / 4.0 * (work @ seen.share) / seen.share.sum() / volume / P)


def apart(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Mean distance between the boundaries of two discs that push each other, in cells.

    Boundaries are polygons with ten points to a side.
    """
    boundary, pairs = scene.outlines, network(state).pairs
    begin, end = (state.x[:, points].T[:, None] for points in (boundary.point, boundary.point[boundary.next]))
    along = np.linspace(0.0, 1.0, 10, endpoint=False)[:, None]
    boundaries = (1.0 - along) * begin + along * end
    trees = [KDTree(boundaries[boundary.body == b].reshape(-1, 2)) for b in range(len(scene.bodies))]
    nearest = [trees[a].query(trees[b].data)[0].min() for a, b in pairs[:, pairs[1] >= 0].T]
    return float(np.mean(nearest)) / scene.cell if nearest else np.nan


def polygons(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Mean excess of perimeter^2 / (4 pi area) of the discs over that of ellipses as long and wide.

    0 for circles and ellipses, 0.10 for hexagons.
    """
    boundary, n = scene.outlines, len(scene.bodies)
    x = state.x[:, boundary.point]
    shape = skmpm.outline.perimeter(boundary, x, n) ** 2 / (4.0 * np.pi * skmpm.outline.area(boundary, x, n))
    long, short, _ = skmpm.outline.dimensions(boundary, x, n)
    return float((shape - ellipse(long / short)).mean())


def ellipse(ratio: Array) -> Array:
    """perimeter^2 / (4 pi area) of ellipses, Ramanujan's first formula (error 1e-6 at a ratio of 2)."""
    half = 3.0 * (ratio + 1.0) - np.sqrt((3.0 * ratio + 1.0) * (ratio + 3.0))
    return half**2 / (4.0 * ratio)
