"""Whether the errors that `skmpm.suggest` predicts hold on scenes that are not in the study.

    OPENBLAS_NUM_THREADS=1 python -m examples.studies.work_precision promises --docs docs

Four scenes, one of each kind, unlike the study's in shape, size, material, speed and friction, are run at the cell,
spacing and time step that `suggest` gives for several errors, with `Scheme.balanced()`. The ratio of their errors,
against another solver, a formula or a fine run, to the requested ones goes to the docs; it should be below two.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from time import process_time

import numpy as np
from numpy.typing import NDArray
from skfem import LinearForm

import skmpm
from skmpm.material import wave_speed
from skmpm.scene import fitted_motions

from .. import pages
from ..pages import table
from . import discs, hertz
from .beam import Elements, clamped
from .statics import DENSITY, LAWS, E, rotation, turned
from .tables import number

Array = NDArray[np.float64]
Resolution = tuple[float, float, float]  # cell [m], spacing [m], dt [s]
Errors = dict[str, float]

PROMISE = 2.0
POSITIONS = ((0.3, 0.4, 0.2), (0.62, 0.17, 1.1), (0.11, 0.83, 2.5), (0.87, 0.55, 0.7))  # offset [cells], angle

# A block twice as long as high, held at its left end, bends under its own weight.
BLOCK, WEIGHT = (2.0, 1.0), 1e-3  # [m]; gravity over E / (density height)
# A disc of hard rubber between plates, without friction.
SMALL, RUBBER, APPROACHES = 0.01, skmpm.LinearElastic(3e5, 0.45, 1100.0), (0.015, 0.05)  # [m], each plate [radii]
# A disc flung at a rough floor, with spin.
FLUNG, FOAM, SPEED, SPIN, ROUGH = 0.05, skmpm.NeoHookean(4e5, 0.2, 700.0), (1.5, -2.5), 20.0, 0.4
# Nine discs squeezed by a lid.
PEAS, STUFF, SLIDING, LID, START, END = 9, skmpm.NeoHookean(2e5, 0.3, 1000.0), 0.2, 0.1, 0.72, 0.88
RADII = np.random.default_rng(17).uniform(3e-3, 5e-3, PEAS)


def block(at: Resolution) -> Errors:
    """Deflection of the far end, and stress as in the study, against quadratic finite elements."""
    cell, spacing, _ = at
    g = WEIGHT * E / DENSITY / BLOCK[1]
    found = []
    for *offset, angle in POSITIONS[:2]:
        shift, turn = cell * np.array(offset), rotation(angle)
        cloud = skmpm.box((0, 0), BLOCK, spacing=spacing)

        def left(x: Array, turn: Array = turn, shift: Array = shift) -> Array:
            return np.asarray(turn[:, 0] @ (x - shift[:, None]) < 1e-9)

        body = skmpm.Body(turned(cloud, angle, shift), LAWS["own"])
        scene = skmpm.Scene([body], cell=cell, supports=[skmpm.Support(left)], gravity=tuple(-g * turn[:, 1]))
        scheme = skmpm.Scheme.balanced(inertia=False)
        state = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), 1.0, scheme=scheme)
        inside = np.abs(cloud.x[0] - 0.5 * BLOCK[0]) < 0.25 * BLOCK[0]
        moved, stress = heavy(g).at(cloud.x)
        off = np.einsum("ki,ijn,lj->kln", turn.T, state.stress, turn.T) - stress
        end, share = cloud.x[0] > BLOCK[0] - 1e-9, cloud.volume[inside]
        sunk = (turn.T @ (state.x - scene.initial_positions))[1, end].mean() / moved[1, end].mean()
        spread = ((off[:, :, inside] ** 2) @ share).sum() / ((stress[:, :, inside] ** 2) @ share).sum()
        found.append({"tip": abs(sunk - 1.0), "stress": np.sqrt(spread)})
    return together(found)


@cache
def heavy(gravity: float) -> Elements:
    """The block by quadratic elements, 24 across."""
    weight = LinearForm(lambda v, w: -DENSITY * gravity * v[1])
    return clamped(BLOCK, 24, weight.assemble)


def rubber(at: Resolution) -> Errors:
    """Force at the first approach and half-width at the second against Hertz in the plane, as it is.

    A narrower contact errs more: at the first approach, half as wide, its width is two to three times as far off.
    """
    cell, spacing, _ = at
    modulus = RUBBER.E / (1.0 - RUBBER.nu**2)
    known_force, known_width = hertz.formula(APPROACHES[0])[0], hertz.formula(APPROACHES[1])[1]
    found = []
    for *offset, angle in POSITIONS:
        middle, normal = cell * np.array(offset), rotation(angle)[:, 1]
        body = skmpm.Body(turned(skmpm.disc((0, 0), SMALL, spacing=spacing), 0.7 * angle, middle), RUBBER)
        walls = [
            skmpm.Wall(middle + s * SMALL * normal, -s * normal, velocity=-s * SMALL * normal) for s in (1.0, -1.0)
        ]
        scene, scheme = skmpm.Scene([body], cell=cell, walls=walls), skmpm.Scheme.balanced(inertia=False)
        first = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), APPROACHES[0], scheme=scheme)
        second = skmpm.step(scene, first, APPROACHES[1] - APPROACHES[0], scheme=scheme)
        force, _ = hertz.pressed(scene, first, middle, normal)
        _, moment = hertz.pressed(scene, second, middle, normal)
        off = abs(force / modulus / SMALL / known_force - 1.0), abs(np.sqrt(moment) / SMALL / known_width - 1.0)
        found.append(dict(zip(("force", "half-width"), off, strict=True)))
    return together(found)


@cache
def flung(at: Resolution, scheme: skmpm.Scheme | None = None) -> dict[str, Array]:
    """Velocity after the floor, along and across it, and R omega, each at two positions, over the speed of fall."""
    cell, spacing, dt = at
    found = []
    for *offset, _ in POSITIONS[:2]:
        shift = cell * np.array(offset)
        cloud = skmpm.disc((shift[0], shift[1] + 1.02 * FLUNG), FLUNG, spacing=spacing)
        body = skmpm.Body(cloud, FOAM, velocity=SPEED, spin=SPIN)
        scene = skmpm.Scene([body], cell=cell, walls=[skmpm.Wall(shift, (0, 1), friction=ROUGH)])
        chosen = scheme or skmpm.Scheme.balanced()
        *_, state = skmpm.simulate(scene, dt=dt, until=0.6 * FLUNG / -SPEED[1] + 0.01, scheme=chosen)
        motion = fitted_motions(state.x, state.v, state.mass, state.body)[:, 0]
        found.append(motion * [1.0, 1.0, FLUNG] / -SPEED[1])
    return dict(zip(("along", "across", "spin"), np.array(found).T, strict=True))


def rebound(at: Resolution) -> Errors:
    """Changes of velocity and spin against those of a fine run, midpoint rule."""
    n, c = 20.0, wave_speed(FOAM)
    mine, known = flung(at), flung((FLUNG / n, 0.5 * FLUNG / n, 0.015 * FLUNG / c), skmpm.Scheme.accurate(theta=0.5))
    before = {"along": -SPEED[0] / SPEED[1], "across": -1.0, "spin": -FLUNG * SPIN / SPEED[1]}
    rms = {name: np.sqrt(np.mean((mine[name] - known[name]) ** 2)) for name in before}
    return {name: float(rms[name] / np.abs(known[name].mean() - start)) for name, start in before.items()}


@cache
def peas(at: Resolution, scheme: skmpm.Scheme | None = None) -> dict[str, Array]:
    """Work of the lid, mean pressures in four parts of the stroke, and alpha - 1 at the end."""
    cell, spacing, dt = at
    width = float(np.sqrt(np.pi * (RADII**2).sum() / 0.75))
    packed = skmpm.packing(RADII, width, solid_fraction=START, seed=4)
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=spacing), STUFF)
        for centre, radius in zip(packed.centres.T, packed.radii, strict=True)
    ]
    walls = discs.planes(width, float(packed.height), LID, friction=0.0)
    scene = skmpm.Scene(bodies, cell=cell, walls=walls, friction=SLIDING)
    solid = float(scene.initial_volumes.sum()) / width
    way, lid, pressure, state = [0.0], [], [], None
    until = (float(packed.height) - solid / END) / LID
    for state in skmpm.simulate(scene, dt=dt, until=until, scheme=scheme or skmpm.Scheme.balanced()):
        seen = discs.pressures(scene, state, solid / (float(packed.height) - LID * state.t))
        way.append(state.t / until)
        lid.append(seen["lid"])
        pressure.append(seen["pressure"])
    edges = np.linspace(0.2, 1.0, 5)
    total = (np.append(0.0, np.cumsum(np.array(each) * np.diff(way))) for each in (lid, pressure))
    work, mean = (np.interp(edges, way, one) for one in total)
    alpha = float(skmpm.observe(scene, state).aspect_ratio) if state is not None else np.nan
    return {"work": work[-1:] - 0.0, "pressure": np.diff(mean), "alpha": np.array([alpha - 1.0])}


def squeezed(at: Resolution) -> Errors:
    """Sums of differences over sums, against a fine run."""
    least, n = float(RADII.min()), 12.0
    known = peas((least / n, 0.5 * least / n, 0.003 * least / LID), skmpm.Scheme.accurate())
    mine = peas(at)
    return {name: float(np.abs(mine[name] - each).sum() / np.abs(each).sum()) for name, each in known.items()}


def together(found: list[Errors]) -> Errors:
    """Root mean square over positions."""
    return {name: float(np.sqrt(np.mean([one[name] ** 2 for one in found]))) for name in found[0]}


@dataclass(frozen=True)
class Promise:
    """A scene, in words and as one to ask about, and how its errors are measured."""

    name: str
    against: str
    asked: skmpm.Scene
    measure: Callable[[Resolution], Errors]
    errors: tuple[float, ...]  # to ask for


def promises() -> list[Promise]:
    """All of them; the scenes that are asked about are coarse ones of the same bodies."""
    coarse = FLUNG / 4.0
    floor, lid = skmpm.Wall((0, 0), (0, 1)), skmpm.Wall((0, 1), (0, -1), velocity=(0.0, -LID))
    row = [skmpm.Body(skmpm.disc((3.0 * i * RADII.max(), 0.1), r, spacing=r / 4), STUFF) for i, r in enumerate(RADII)]
    plank = skmpm.Body(skmpm.box((0, 0), BLOCK, spacing=0.1), LAWS["own"])
    ball = skmpm.Body(skmpm.disc((0, SMALL), SMALL, spacing=SMALL / 5), RUBBER)
    thrown = skmpm.Body(skmpm.disc((0, FLUNG), FLUNG, spacing=coarse), FOAM, velocity=SPEED, spin=SPIN)
    return [
        Promise("a block bends by its weight", "quadratic elements", skmpm.Scene([plank], cell=0.1), block, ALL),
        Promise("rubber disc between plates", "Hertz", skmpm.Scene([ball], cell=coarse, walls=[floor]), rubber, ALL),
        Promise("disc flung at a floor", "fine run", skmpm.Scene([thrown], cell=coarse, walls=[floor]), rebound, ALL),
        Promise("nine discs and a lid", "fine run", skmpm.Scene(row, cell=coarse, walls=[lid]), squeezed, LARGE),
    ]


QUANTITIES = ("tip", "stress", "force", "half-width", "along", "across", "spin", "work", "pressure", "alpha")
HEAD = ("scene", "against", "asked [%]", "cell [m]", "spacing [m]", "dt [s]", "largest / asked",
        "time with references [s]", *(f"{name} [%]" for name in QUANTITIES))  # fmt: skip
ALL, LARGE = (0.2, 0.1, 0.05, 0.02), (0.2, 0.1, 0.05)


def line(promise: Promise, error: float) -> tuple[tuple[str, ...], bool]:
    """A row of the file (`HEAD`), and whether the promise is kept."""
    asked = skmpm.suggest(promise.asked, error=error)
    at = (asked.cell, asked.spacing, asked.dt)
    began = process_time()
    found = promise.measure(at)
    largest = max(found.values())
    each = (number(100.0 * found[name]) if name in found else "-" for name in QUANTITIES)
    resolution = tuple(f"{value:.3g}" for value in at)
    cost = f"{number(process_time() - began)}"
    row = (promise.name, promise.against, f"{100.0 * error:g}", *resolution, number(largest / error), cost, *each)
    print(*row, flush=True)
    return row, largest <= PROMISE * error


def short(lines: list[tuple[str, ...]]) -> str:
    """The largest error over what was asked for, by scene and error."""
    ratios = {(name, asked): ratio for name, _, asked, _, _, _, ratio, *_ in lines}
    asked = list(dict.fromkeys(error for _, error in ratios))
    rows = [
        (name, against, *(ratios.get((name, error), "-") for error in asked))
        for name, against in dict.fromkeys(line[:2] for line in lines)
    ]
    return table(("scene", "against", *(f"{error} %" for error in asked)), rows)


def main(options: argparse.Namespace) -> bool:
    """Measure, write the table, and return whether all promises are kept."""
    rows = [line(p, error) for p in promises() if p.name in (options.only or p.name) for error in p.errors]
    kept = sum(good for _, good in rows)
    verdict = (
        f"Within a factor of {PROMISE:g}: {kept} of {len(rows)}, {'met' if kept == len(rows) else '**missed**'}."
    )
    if not options.only:
        lines = [row for row, _ in rows]
        pages.keep(options.docs / "work_precision", {"promises": [HEAD, *lines]})
        pages.put(options.docs / "work_precision.md", {"promises": f"{short(lines)}\n\n{verdict}"})
    return kept == len(rows)


def parser() -> argparse.ArgumentParser:
    """Where the page is, and which scenes."""
    options = pages.parser(__doc__, "work_precision.md")
    options.add_argument("--only", nargs="*", default=[], help="scenes by name; nothing is written then")
    return options
