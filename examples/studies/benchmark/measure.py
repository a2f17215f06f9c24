"""One workload of `study.py`, measured in a process of its own: its size, times and memory.

python -m examples.studies.benchmark.measure '{"kind": "dense", "discs": 10, ...}' result.json cache
"""

from __future__ import annotations

import json
import resource
import sys
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import skmpm
from examples import compaction
from skmpm import linear
from skmpm.linear.band import column_lengths, half_bandwidth
from skmpm.parallel import available

from . import scenes

WARM = 2  # steps before those that are measured
NARROW = 150  # half bandwidth up to which the bodies' own order is tried
LARGEST_LU = 800_000  # unknowns; beyond, one LU takes longer than all the rest
ENSEMBLE = 0.75  # nominal solid fraction at which the members of an ensemble end
WITHOUT = ("transfer", "factorisation", "bulk", "report", "overlap")  # phases of a step without contact
Result = dict[str, Any]


def peak() -> float:
    """Largest memory of this process so far [MB]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def resident() -> float:
    """Memory of this process now [MB]; its largest so far where the system does not tell."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * resource.getpagesize() / 1e6 if statm.exists() else peak()


IMPORTED = peak()


@dataclass
class Recorder:
    """A linear solver that records its arguments and results."""

    solver: linear.Linear
    matrices: list[sp.bsr_array] = field(default_factory=list)
    made: list[linear.Solver] = field(default_factory=list)

    def __call__(self, A: sp.bsr_array, blocks: np.ndarray, rigid_motions: np.ndarray) -> linear.Solver:
        """As the solver does."""
        self.matrices.append(A)
        self.made.append(self.solver(A, blocks, rigid_motions))
        return self.made[-1]


def lu(A: sp.bsr_array) -> dict[str, float]:
    """Time of one sparse LU [s]: the fastest with pivots on the diagonal, all that A needs; as `linear.direct`."""
    columns = A.tocsc()

    def seconds(ordering: str, threshold: float) -> float:
        began = process_time()
        spla.splu(columns, ordering, diag_pivot_thresh=threshold, options={"SymmetricMode": True})
        return process_time() - began

    found = [seconds("MMD_AT_PLUS_A", 0.0)]
    width = half_bandwidth(column_lengths(A, np.array([0, A.shape[0]])))
    if width < NARROW:  # bodies in their own order: less fill than minimum degree
        found.append(seconds("NATURAL", 0.0))
    return {"lu": min(found), "lu_direct": seconds("MMD_AT_PLUS_A", 1.0)}


def timed(
    scene: skmpm.Scene, state: skmpm.State, dt: float, scheme: skmpm.Scheme
) -> tuple[skmpm.State, dict[str, float], dict[str, float]]:
    """One step: its processor (and of that the system's) and wall time, and its phases in processor time [s]."""
    wall, cpu, system = perf_counter(), process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_stime
    state = skmpm.step(scene, state, dt, scheme=scheme)
    wall, cpu = perf_counter() - wall, process_time() - cpu
    system = resource.getrusage(resource.RUSAGE_SELF).ru_stime - system
    phases = {name: seconds * cpu / wall for name, seconds in state.report.seconds.items()}
    return state, {"step": cpu, "system": system, "wall": wall}, phases


def steps(scene: skmpm.Scene, state: skmpm.State, repeats: int) -> tuple[skmpm.State, Result]:
    """Medians over `repeats` steps, with one and with all threads in turn, each beside an LU of the same matrix."""
    *_, state = skmpm.simulate(scene, dt=scenes.DT, until=state.t + WARM * scenes.DT, start=state)
    memory = peak() - IMPORTED
    recorder = Recorder(linear.default)
    skmpm.step(scene, state, scenes.DT, scheme=skmpm.Scheme(linear=recorder))
    A, spent, laps, newton = recorder.matrices[-1], [], [], []
    recorder.matrices, recorder.made = [], []
    threaded = []
    for _ in range(repeats):
        state, times, _ = timed(scene, state, scenes.DT, skmpm.Scheme())
        threaded.append(times["wall"])
        state, times, phases = timed(scene, state, scenes.DT, skmpm.Scheme(threads=1))
        spent.append({**times, **(lu(A) if A.shape[0] <= LARGEST_LU else {})})
        laps.append(phases)
        newton.append(state.report.newton)
    return state, {
        **medians(spent),
        "wall_threaded": float(np.median(threaded)),
        "cores": available(),
        "phases": medians(laps),
        "newton": float(np.mean(newton)),
        "unknowns": A.shape[0],
        "memory": memory,
        "points": state.x.shape[1],
    }


def medians(lines: list[dict[str, float]]) -> dict[str, float]:
    """Of every column, zero where a line has none."""
    names = dict.fromkeys(name for line in lines for name in line)
    return {name: float(np.median([line.get(name, 0.0) for line in lines])) for name in names}


def free(setup: Result, cache: Path) -> Result:
    """Steps of discs that touch nothing."""
    scene, state = scenes.free(setup["discs"], setup["cells"], setup["law"])
    return steps(scene, state, setup["repeats"])[1]


def dense(setup: Result, cache: Path) -> Result:
    """Steps of a dense packing."""
    scene, state = scenes.dense(setup["discs"], setup["cells"], setup["friction"], setup["tile"], cache)
    state, found = steps(scene, state, setup["repeats"])
    pressed = state.contacts.force[0] > 0.0
    pairs = np.sort(state.contacts.bodies[:, pressed], axis=0)
    return {
        **found,
        "fraction": scenes.fraction(scene, state),
        "contacts": int(state.contacts.gap.size),
        "forced": int(pressed.sum()),
        "pairs": int(np.unique(pairs, axis=1).shape[1]),
        "contact_phases": found["step"] - sum(found["phases"].get(name, 0.0) for name in WITHOUT),
    }


def tile(setup: Result, cache: Path) -> Result:
    """Make a tile."""
    _, state = scenes.squeezed(setup["discs"], setup["cells"], setup["friction"], cache)
    return {"points": state.x.shape[1]}


def single(setup: Result, cache: Path) -> Result:
    """One body of that many points by pyamg: a quasi-static step and a dynamic one."""
    found: Result = {}
    for name in ("quasi-static", "dynamic"):
        scene, counts = scenes.single(setup["about"], pulled=name == "quasi-static"), list[int]()
        recorder = Recorder(partial(linear.amg, callback=counts.append))
        scheme = skmpm.Scheme(inertia=name == "dynamic", linear=recorder)
        state = skmpm.initial(scene, scheme=scheme)
        state, times, phases = timed(scene, state, 10.0 * scene.cell / scene.fastest_wave, scheme)
        found[name] = {
            **times,
            "newton": state.report.newton,
            "iterations": max(counts),
            "setups": len(recorder.made),
            "phases": phases,
            "imbalance": state.report.imbalance,
        }
        A = recorder.matrices[-1]
        found.update(unknowns=A.shape[0], points=state.x.shape[1], memory=peak() - IMPORTED)
        if A.shape[0] <= 200_000:
            found[name].update(lu(A))
    return found


def memory(setup: Result, cache: Path) -> Result:
    """Resident memory after a tenth, half and all of many steps of a small scene [MB]."""
    scene = scenes.breathing(setup["discs"], setup["cells"], period=setup["steps"] / 8 * scenes.DT)
    touched, seen = 0, {}
    run = skmpm.simulate(scene, dt=scenes.DT, until=setup["steps"] * scenes.DT)
    for k, state in enumerate(run, start=1):
        touched += bool(state.contacts.force.any())
        for name, share in (("early", 10), ("middle", 2), ("late", 1)):
            if k == setup["steps"] // share:
                seen[name] = resident()
    return {**seen, "touched": touched, "points": state.x.shape[1]}


def member(discs: int, seed: int) -> skmpm.Run:
    """The first steps of a compaction."""
    options = compaction.parser().parse_args([])
    vars(options).update(discs=discs, seed=seed, until=ENSEMBLE)
    scene, until = compaction.build(options)
    return skmpm.Run(scene, until, dt=options.dt)


def ensemble(setup: Result, cache: Path) -> Result:
    """Wall time of a sweep, its processes and their imports included [s]."""
    members = [{"discs": setup["discs"], "seed": seed} for seed in range(setup["members"])]
    with TemporaryDirectory() as out:
        began = perf_counter()
        found = skmpm.sweep(member, members, out=out, processes=setup["processes"])
        seconds = perf_counter() - began
    if len(found.finished) != len(members):
        raise RuntimeError(f"members failed: {found.failed}")
    return {"step": seconds, "rows": sum(m.columns["t"].size for m in found)}


KINDS = {"ensemble": ensemble, "free": free, "dense": dense, "tile": tile, "single": single, "memory": memory}


def main(setup: Result, cache: Path) -> Result:
    """The result of one workload."""
    began = perf_counter()
    found = KINDS[setup["kind"]](setup, cache)
    return {**setup, **found, "total": perf_counter() - began, "imported": IMPORTED}


if __name__ == "__main__":
    result = main(json.loads(sys.argv[1]), Path(sys.argv[3]))
    partial = Path(sys.argv[2]).with_suffix(".part")
    partial.write_text(json.dumps(result, indent=1) + "\n")
    partial.replace(sys.argv[2])
