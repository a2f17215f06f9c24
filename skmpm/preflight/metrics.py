"""The numbers of the preflight check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm import linear
from skmpm.arrays import Array, Ints
from skmpm.contact import acts_at_grid_nodes, check_outlines
from skmpm.contact.self_contact import can_touch
from skmpm.grid import BodyGrids, build_grids
from skmpm.grid.assembly import ghost_facets
from skmpm.material import poisson_ratio, youngs_modulus
from skmpm.outline import chord_sagitta, inclined_thickness, slit_width
from skmpm.preflight.sampling import stress_errors
from skmpm.scene import Derived, Scene, check_walls_at_start
from skmpm.scheme import Scheme
from skmpm.step.algorithm import SHORTEST, check_time
from skmpm.step.driven import check_driven, driven, driven_by_force
from skmpm.step.functions_of_time import TIMES, FunctionsOfTime
from skmpm.step.initial_state import check_cohesion, initial_motion
from skmpm.step.loading import loading_of
from skmpm.step.regrid import derived_data, inward_normals, torn_bodies


@dataclass(frozen=True, eq=False)
class SceneMetrics:
    """The numbers of the preflight check; arrays are per deformable body, motions at t = 0 or after falling."""

    points: Ints  # (bodies,) including rigid ones
    own: Ints  # (deformable,) indices among the bodies
    points_per_cell: Array  # (deformable,) points over area in cells
    softening: Array  # (deformable,) estimated error of a uniform stress; nan without outline
    torn: dict[int, int]  # bodies whose cells fall apart: number of pieces
    resolution: Array  # (deformable,) R/h, R the radius of a disc of that area
    across: Array  # (deformable,) cells across the thinnest part; nan without outline
    inclined: Array  # (deformable,) the same of parts inclined to the grid, of bodies wider than those; else inf
    chords: Array  # (deformable,) by which chords of a smooth outline cut off from a width at most [cells]
    slit: Array  # (deformable,) cells across the narrowest slit or hole; inf without one
    cells: int
    unknowns: int
    cell: float  # h [m]
    wave: float  # fastest pressure wave c [m/s]
    courant: float  # dt c/h
    waves: bool  # whether steps must resolve waves
    lid: float  # displacement of the fastest wall, rigid body or support in a step [cells]
    lid_name: str  # its name
    approach: float  # bound on the relative displacement in a step [cells]; 0 without inertia
    fall: float  # free height, 0 without gravity or inertia [m]
    rotation: Array  # (deformable,) largest rotation of points in a step [rad]
    touches: bool  # whether contact is possible
    friction: float  # largest coefficient
    cohesion: float  # the largest [Pa]
    young: Array  # (materials,) small-strain moduli of the deformable bodies [Pa]
    poisson: Array  # (materials,) Poisson's ratios
    inertia: bool
    half_bandwidth: int
    solver: str
    memory: float  # [bytes] in addition to the program
    steps: float = np.inf  # of the run, if its end is known


def examine(scene: Scene, dt: float, scheme: Scheme, until: float | None = None) -> SceneMetrics:
    """The numbers of a scene; its body grids are built, nothing is assembled or solved.

    Of functions of time the largest values up to `until` [s] count. Without it, which waves matter is not known.
    """
    check_time("preflight: dt", dt, SHORTEST, "None for chosen steps, or a time step greater than zero")
    check_cohesion("preflight", scene, scheme)
    check_walls_at_start(scene)
    check_driven("preflight", scene, scheme)
    if can_touch(scene) and not acts_at_grid_nodes(scheme.contact):
        check_outlines(scene)
    own, count, body = np.flatnonzero(scene.deformable), np.diff(scene.offsets), scene.owner
    area = np.bincount(body, scene.initial_volumes, count.size)[own] / scene.cell**2
    wave, (grid, columns) = scene.fastest_wave, _grid(scene, scheme)
    width, solver = int(columns.max(initial=1)) - 1, _solver(scheme, columns)
    touches, step = can_touch(scene), dt / scene.cell
    times = np.zeros(1) if until is None else until * np.append(0.0, (np.arange(TIMES) + 0.5) / TIMES)
    known = until is not None or FunctionsOfTime.in_run(scene, scheme.theta, times).none
    fastest = (named for t in times.tolist() for named in driven(scene, t))
    lid_name, lid = max(fastest, key=lambda named: named[1], default=("", 0.0))
    if not lid:
        lid_name = ", ".join(name for name, _ in driven_by_force(scene))
    loading, (_, C) = loading_of(scene, times), initial_motion(scene)
    rotation = np.zeros(count.size)
    np.maximum.at(rotation, body, 0.5 * dt * np.abs(C[1, 0] - C[0, 1]))
    boundary, x = scene.outlines, scene.initial_positions[:, scene.outlines.point]
    thin = np.zeros(count.size, dtype=bool)
    thin[own] = scene.thickness[own] < np.sqrt(area / np.pi) * scene.cell
    return SceneMetrics(
        points=count,
        own=own,
        points_per_cell=count[own] / area,
        softening=stress_errors(scene, fitted=scheme.moment_fitting)[own],
        torn={b: int(grid.pieces[b]) for b in torn_bodies(scene, grid).tolist()},
        resolution=np.sqrt(area / np.pi),
        across=scene.thickness[own] / scene.cell,
        inclined=inclined_thickness(boundary, x, thin)[own] / scene.cell,
        chords=2.0 * chord_sagitta(boundary, x, count.size)[own] / scene.cell,
        slit=slit_width(boundary, x, count.size)[own] / scene.cell,
        cells=grid.cells,
        unknowns=2 * grid.nodes,
        cell=scene.cell,
        wave=wave,
        courant=wave * step if scheme.inertia else 0.0,
        waves=scheme.inertia and loading.waves and known,
        lid=lid * step,
        lid_name=lid_name,
        approach=loading.approach * step if touches and scheme.inertia else 0.0,
        fall=loading.fall if scheme.inertia else 0.0,
        rotation=rotation[own],
        touches=touches,
        friction=scene.frictions.largest if touches else 0.0,
        cohesion=float(max([scene.cohesion, *(wall.cohesion for wall in scene.walls)])) if touches else 0.0,
        young=np.array([youngs_modulus(material) for material in scene.materials]),
        poisson=np.array([poisson_ratio(material) for material in scene.materials]),
        inertia=scheme.inertia,
        half_bandwidth=width,
        solver=solver,
        memory=memory_of(int(count.sum()), 2 * grid.nodes, boundary.size if touches else 0, width, solver),
    )


def _grid(scene: Scene, scheme: Scheme) -> tuple[BodyGrids, Ints]:
    """The first body grids, and the lengths (nodes,) of the columns of the factor of their matrix, with supports."""
    soft, x, volume = scene.deformable[scene.owner], scene.initial_positions, scene.initial_volumes
    if scene.supports:
        return _supported_grid(derived_data(scene, scheme, x, volume))
    grid = build_grids(
        x[:, soft], scene.owner[soft], scene.cell, len(scene.bodies), inward_normals(scene, x)[:, soft]
    )
    facets, _ = ghost_facets(grid, volume[soft])
    node = np.arange(grid.nodes)
    last = node.copy()
    for nodes in (grid.nodes_of_cell, facets):
        np.maximum.at(last, nodes.min(axis=0), nodes.max(axis=0))
    return grid, 2 * (np.maximum.accumulate(last) - node + 1)


def _supported_grid(data: Derived) -> tuple[BodyGrids, Ints]:
    """The same with supports, whose elimination couples further nodes and reorders them."""
    grid, pattern = data.assembly.grid, data.assembly.ghost_data
    A = data.assembly.matrix(np.random.default_rng(0).random(pattern.shape), 1.0)  # whose entries do not cancel
    if data.supports is not None:
        A, _ = data.supports.reduced(A, grid.blocks)
    return grid, linear.column_lengths(A, grid.blocks)


def _solver(scheme: Scheme, columns: Ints) -> str:
    """Name of the solver: that which `linear.default` selects, otherwise the scheme's own."""
    solver = linear.chosen(columns) if scheme.linear is linear.default else scheme.linear
    return str(getattr(solver, "__name__", type(solver).__name__))


def memory_of(points: int, unknowns: int, boundaries: int, width: int, solver: str) -> float:
    """Peak memory of a run in addition to the program [bytes]; `boundaries` is the number of boundary points.

    8 MB + 1.2 kB a point + 5 kB a boundary point, and for the matrix a band of half bandwidth `width`, or 2 kB an
    unknown by any other solver. Fitted to peak resident sizes above those after import. Estimate over measured: the
    main job's first steps, 60 and 300 discs, R/h = 5, 1.3, a dense packing of 300 discs 0.85; before the bulk was
    compiled, one body by amg, 1e4, 1e5 and 1e6 points, 1.05, 1.15 to 1.3, 0.78.
    """
    matrix = 8.0 * (width + 1) * unknowns if solver == "banded" else 2e3 * unknowns
    return 8e6 + 1.2e3 * points + 5e3 * boundaries + matrix
