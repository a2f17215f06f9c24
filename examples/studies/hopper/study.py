"""Soft discs leave a hopper until it is empty or clogged.

    python -m examples.studies.hopper --out out/hopper    # run what is missing, write the page
    python -m examples.studies.hopper figures             # draw the figure, write the page

Every member is one run by `skmpm.sweep`, in stages. Discs settle on a gate, which is then taken away. A stage ends
when a disc has left the outlet, and the next one goes on without it. Steps are chosen (``dt=None``). Then the page is
written.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

import skmpm
from skmpm.sweep import Member

from ..pages import picture, table
from ..sweeps import groups

D, DENSITY, GRAVITY, POISSON = 1e-2, 1000.0, 9.81, 0.3  # mean diameter [m]; [kg/m3]; [m/s2]
SIZES = (0.9, 1.1)  # diameters over the mean one, half of the discs each
CELL = D / 8.0  # four cells in the mean radius
SPACING = 0.74 * CELL
WIDTH = 5.0 * D  # between the side walls
SLOPE = np.pi / 6.0  # of the hopper
LIP = 0.25 * D  # radius of the bars of the hopper
DAMPING = 0.5  # viscosity over the mean diameter times sqrt(density E)
TIME = float(np.sqrt(D / GRAVITY))  # [s] in which a disc falls half a diameter
SPEED = float(np.sqrt(GRAVITY * D))  # [m/s]
REST = 1e-3  # largest speed of discs at rest, over SPEED
SETTLED = 0.1  # the same on the gate, when it is taken away
PATIENCE = 5.0  # least time of a stage at whose end discs are at rest, over TIME
LONGEST = 100.0  # time between two discs, over TIME, after which a flow is given up
SIMULATE = partial(skmpm.simulate, waves=False)  # as long steps of the last discs as of all
HEAD = ("friction", "softness", "flattening [%]", "w/d", "packings", "clogged", "discs that left",
        "discs remaining in a clog", "discs in an arch", "steps", "retries", "time [min]")  # fmt: skip
POINT = ("friction", "softness", "outlet")
Row = dict[str, Any]


def bars(outlet: float) -> skmpm.Body:
    """Both slopes of the hopper, fixed; their lips are `outlet` [m] apart at y = 0."""
    length = 0.5 * (WIDTH - outlet) / np.cos(SLOPE)
    middle = 0.5 * outlet + LIP + 0.5 * length * np.cos(SLOPE), 0.5 * length * np.sin(SLOPE)
    sides = [
        skmpm.capsule((s * middle[0], middle[1]), length, LIP, spacing=SPACING, angle=s * SLOPE) for s in (-1.0, 1.0)
    ]
    return skmpm.Body(skmpm.joined(sides), skmpm.Rigid(DENSITY), motion=(0.0, 0.0, 0.0))


def places(discs: int, outlet: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres (2, discs) and radii (discs,) of a loose packing in the hopper, the lowest first."""
    radii = 0.5 * D * np.resize(SIZES, max(2 * discs, 40))
    loose = skmpm.packing(np.random.default_rng(seed).permutation(radii), WIDTH, solid_fraction=0.72, seed=seed)
    x, y = loose.centres - np.array([[0.5 * WIDTH], [0.0]])
    y = y - LIP  # the gate
    across = np.sin(SLOPE) * (0.5 * outlet + LIP - np.abs(x)) + np.cos(SLOPE) * y  # height above the axis of a bar
    free = np.flatnonzero(across > loose.radii + LIP)
    chosen = free[np.argsort(y[free])[:discs]]
    return np.stack([x, y])[:, chosen], loose.radii[chosen]


def scene(discs: int, outlet: float, softness: float, friction: float, seed: int) -> skmpm.Scene:
    """Discs in the hopper above the closed gate; the hopper is the last body, the gate the last wall."""
    young = DENSITY * GRAVITY * D / softness
    gel = skmpm.NeoHookean(young, POISSON, DENSITY, viscosity=DAMPING * D * np.sqrt(DENSITY * young))
    centres, radii = places(discs, outlet * D, seed)
    bodies = [skmpm.Body(skmpm.disc(x, r, spacing=SPACING), gel) for x, r in zip(centres.T, radii, strict=True)]
    sides = [skmpm.Wall((s * 0.5 * WIDTH, 0.0), (-s, 0.0)) for s in (-1.0, 1.0)]
    gate = skmpm.Wall((0.0, -LIP), (0.0, 1.0))
    return skmpm.Scene(
        [*bodies, bars(outlet * D)], cell=CELL, walls=[*sides, gate], friction=friction, gravity=(0.0, -GRAVITY)
    )


def opened(full: skmpm.Scene, here: Sequence[int]) -> skmpm.Scene:
    """The scene without the gate, with those of its discs that are still `here`."""
    return replace(full, walls=full.walls[:-1], bodies=[*(full.bodies[i] for i in here), full.bodies[-1]])


def left(scene: skmpm.Scene, state: skmpm.State) -> np.ndarray:
    """Which discs are wholly below the lips, (discs,)."""
    discs = state.body < len(scene.bodies) - 1
    top = np.full(len(scene.bodies) - 1, -np.inf)
    np.maximum.at(top, state.body[discs], state.x[1, discs])
    return np.asarray(top < 0.0)


def row(here: Sequence[int], begun: float, scene: skmpm.Scene, state: skmpm.State) -> Row:
    """One line of the table: discs in the hopper, the speed of the fastest, and what bears their weight."""
    discs = state.body < len(scene.bodies) - 1
    body, mass = state.body[discs], state.mass[discs]
    speed = np.hypot(*(np.bincount(body, mass * v[discs]) / np.bincount(body, mass) for v in state.v))
    borne = state.body_force[1, -1] + state.wall_force[:, 1].sum()
    return {
        "here": " ".join(map(str, here)),
        "inside": int(np.sum(~left(scene, state))),
        "outside": int(np.sum(left(scene, state))),
        "gate": len(state.walls) - 2,
        "lasted": (state.t - begun) / TIME,
        "speed": float(speed.max()) / SPEED,
        "borne": -float(borne) / (GRAVITY * float(mass.sum())),
        "dt": state.report.dt,
        "retries": state.report.retries,
        "overlap": state.report.overlap,
        "seconds": sum(state.report.seconds.values()),
    }


def at_rest(row: Row) -> bool:
    """Whether all discs have come to rest: in the hopper without a gate, it is clogged."""
    return bool(row["lasted"] > PATIENCE and row["speed"] < (SETTLED if row["gate"] else REST))


def stage(full: skmpm.Scene, here: Sequence[int], start: skmpm.State) -> skmpm.Run:
    """From the opened gate or the last disc that has left, until another one has left, or until rest."""
    scene = opened(full, here)
    return skmpm.Run(
        scene,
        start.t + LONGEST * TIME,
        start=start,
        observe=partial(row, here, start.t),
        stop=lambda row: row["outside"] > 0 or at_rest(row),
        keep={"half": lambda row: 2 * len(here) <= len(full.bodies) - 1},
        then=partial(after, full, here),
        simulate=SIMULATE,
    )


def after(full: skmpm.Scene, here: Sequence[int], state: skmpm.State) -> skmpm.Run:
    """What follows a stage: another one without the discs that have left, or none in an empty or a clogged hopper."""
    scene = opened(full, here)
    out = left(scene, state)
    if out.all() or not out.any():
        return skmpm.Run(scene, state.t, start=state)
    kept = [i for i, gone in zip(here, out, strict=True) if not gone]
    return stage(full, kept, skmpm.continued(scene, state, opened(full, kept)))


def build(discs: int, outlet: float, softness: float, friction: float, seed: int) -> skmpm.Run:
    """A member: the gate is opened when the discs have settled on it."""
    full = scene(discs, outlet, softness, friction, seed)
    here = range(discs)

    def then(state: skmpm.State) -> skmpm.Run:
        return stage(full, here, skmpm.continued(full, state, opened(full, here)))

    return skmpm.Run(
        full, LONGEST * TIME, observe=partial(row, here, 0.0), stop=at_rest, then=then, simulate=SIMULATE
    )


def members(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Parameters of `build`: every outlet at every softness, for every packing."""
    return [
        {"discs": options.discs, "friction": options.friction, "outlet": w, "softness": s, "seed": seed}
        for seed in range(options.seeds)
        for w in options.outlet
        for s in options.softness
    ]


def add_options(options: argparse.ArgumentParser) -> None:
    """Options; the defaults are the study of `docs/studies/hopper.md`."""
    options.add_argument("--discs", type=int, default=30, help="number of discs")
    options.add_argument("--outlet", type=float, nargs="+", default=[1.25, 1.6, 1.8], help="over the mean diameter")
    options.add_argument("--softness", type=float, nargs="+", default=[1e-3, 3e-2], help="density g d over E")
    options.add_argument("--friction", type=float, default=0.1, help="friction coefficient of discs and walls")
    options.add_argument("--seeds", type=int, default=4, help="packings at each point")


def flattening(softness: float) -> float:
    """Part of its diameter by which a disc on a plane is flattened by its own weight."""
    gel = skmpm.NeoHookean(DENSITY * GRAVITY * D / softness, POISSON, DENSITY)
    points = skmpm.disc((0.0, 0.5 * D), 0.5 * D, spacing=SPACING)
    floor, gravity = skmpm.Wall((0.0, 0.0), (0.0, 1.0)), (0.0, -GRAVITY)
    scene = skmpm.Scene([skmpm.Body(points, gel)], cell=CELL, walls=[floor], friction=0.1, gravity=gravity)
    state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    return 1.0 - float(np.ptp(state.x[1])) / float(np.ptp(points.x[1]))


def scene_of(member: Member, state: skmpm.State) -> skmpm.Scene:
    """The scene of a state without the gate, from the text of its row that tells which discs are in it."""
    at = int(np.flatnonzero(member.columns["t"] == state.t)[-1])
    return opened(build(**member.parameters).scene, [int(i) for i in str(member.columns["here"][at]).split()])


def inside(member: Member) -> int:
    """Discs in the hopper at the end."""
    return int(member.columns["inside"][-1])


def clogged(member: Member) -> bool:
    """Whether discs rest in the hopper at the end."""
    return inside(member) > 0 and bool(member.columns["speed"][-1] < REST)


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
