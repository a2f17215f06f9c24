"""Figures and page of the hopper study from the tables of its members."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

import skmpm
from examples.studies.hopper import study
from examples.studies.pages import picture, table
from examples.studies.sweeps import groups
from skmpm.sweep import Member

HEAD = ("friction", "softness", "flattening [%]", "w/d", "packings", "clogged", "discs that left",
        "discs remaining in a clog", "discs in an arch", "steps", "retries", "time [min]")  # fmt: skip
POINT = ("friction", "softness", "outlet")


def flattening(softness: float) -> float:
    """Part of its diameter by which a disc on a plane is flattened by its own weight."""
    gel = skmpm.NeoHookean(study.DENSITY * study.GRAVITY * study.D / softness, study.POISSON, study.DENSITY)
    points = skmpm.disc((0.0, 0.5 * study.D), 0.5 * study.D, spacing=study.SPACING)
    floor, gravity = skmpm.Wall((0.0, 0.0), (0.0, 1.0)), (0.0, -study.GRAVITY)
    scene = skmpm.Scene([skmpm.Body(points, gel)], cell=study.CELL, walls=[floor], friction=0.1, gravity=gravity)
    state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    return 1.0 - float(np.ptp(state.x[1])) / float(np.ptp(points.x[1]))


def scene_of(member: Member, state: skmpm.State) -> skmpm.Scene:
    """The scene of a state without the gate, from the text of its row that tells which discs are in it."""
    at = int(np.flatnonzero(member.columns["t"] == state.t)[-1])
    return study.opened(
        study.build(**member.parameters).scene, [int(i) for i in str(member.columns["here"][at]).split()]
    )


def inside(member: Member) -> int:
    """Discs in the hopper at the end."""
    return int(member.columns["inside"][-1])


def clogged(member: Member) -> bool:
    """Whether discs rest in the hopper at the end."""
    return inside(member) > 0 and bool(member.columns["speed"][-1] < study.REST)


def arch(scene: skmpm.Scene, state: skmpm.State) -> int:
    """Discs in the shortest chain of contacts from one slope of the hopper to the other; 0 without one."""
    pairs, discs = skmpm.network(scene, state), len(scene.bodies) - 1
    first, second = pairs.bodies
    slope = np.where(pairs.centre[0] < 0.0, discs, discs + 1)  # of a contact with the hopper
    second = np.where(second == discs, slope, second)
    chain = second >= 0
    links = csr_array((np.ones(chain.sum()), (first[chain], second[chain])), shape=(discs + 2, discs + 2))
    length = shortest_path(links, directed=False, unweighted=True, indices=discs)[discs + 1]
    return int(length) - 1 if np.isfinite(length) else 0


def line(point: tuple[float, ...], members: list[Member]) -> tuple[str, ...]:
    """A row of the table."""
    clogs = [member for member in members if clogged(member)]
    out = sum(member.parameters["discs"] - inside(member) for member in members)
    arches = [arch(scene_of(member, member.state()), member.state()) for member in clogs]
    columns = [member.columns for member in members]
    return (
        f"{point[0]:g}",
        f"{point[1]:g}",
        f"{100.0 * flattening(point[1]):.2g}",
        f"{point[2]:g}",
        f"{len(members)}",
        f"{len(clogs)}",
        f"{out}",
        f"{np.mean([inside(member) for member in clogs]):.1f}" if clogs else "",
        f"{np.mean(arches):.1f}" if clogs else "",
        f"{np.mean([c['t'].size for c in columns]):.0f}",
        f"{sum(c['retries'].sum() for c in columns)}",
        f"{np.mean([c['seconds'].sum() for c in columns]) / 60.0:.1f}",
    )


def packing(axes: plt.Axes, members: list[Member], state: str, title: str) -> None:
    """Draw a state of the first of the members."""
    axes.axis("off")
    if members:
        about, chosen = members[0].parameters, members[0].state(state)
        skmpm.plot(scene_of(members[0], chosen), chosen, "pressure", forces=True, axes=axes)
        what = f"{title}: friction {about['friction']:g}, softness {about['softness']:g}, w/d = {about['outlet']:g}"
        axes.text(0.5, -0.02, what, transform=axes.transAxes, ha="center", va="top")


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """How many members clog, a clogged state of the widest outlet, and a flowing one of the softest discs."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    by_point = groups(found, *POINT)
    for k, (friction, softness) in enumerate(dict.fromkeys(point[:2] for point in by_point)):
        outlets = [w for mu, s, w in by_point if (mu, s) == (friction, softness)]
        share = [np.mean([clogged(m) for m in by_point[friction, softness, w]]) for w in outlets]
        axes[0].plot(outlets, share, "o-", color=f"C{k}", label=f"friction {friction:g}, softness {softness:g}")
    axes[0].set(
        xlabel="width of the outlet over mean diameter", title="share of packings that clog", ylim=(-0.05, 1.05)
    )
    axes[0].legend()
    widest = sorted(filter(clogged, found), key=lambda m: (-m.parameters["outlet"], -inside(m)))
    flows = [m for m in found if (m.folder / "half.checkpoint").exists()]
    softest = sorted(flows, key=lambda m: (inside(m), -m.parameters["softness"], m.parameters["outlet"]))
    packing(axes[1], widest, "last", "clogged")
    packing(axes[2], softest, "half", "flowing")
    picture(figure, folder / "hopper.png", 110)


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The parts of the page that are made of the members."""
    return {"members": table(HEAD, [line(*group) for group in groups(found, *POINT).items()])}
