"""A cantilever against finite elements
====================================

A clamped beam with an end load in one quasi-static step, compared with finite elements of scikit-fem.

    python examples/cantilever.py

Supports and loads act on the boundary points of the body, whatever its position on the grid, here with an offset of
0.3 cells. Without inertia a linear material takes one step, one factorisation and one solve.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from skfem import Basis, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad, condense, solve
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skmpm

LENGTH, DEPTH, FORCE, CELL = 8.0, 1.0, -100.0, 0.125
E, NU = 1e6, 0.3


def material_points(out: Path) -> float:
    """Displacement of the middle of the loaded end [m]."""
    points = skmpm.box((0.3 * CELL, 0.3 * CELL), (LENGTH, DEPTH), spacing=CELL / 3)
    (left, bottom), right = points.x.min(axis=1), points.x[0].max()
    clamp, pull = skmpm.Support(lambda x: x[0] == left), skmpm.Load(lambda x: x[0] == right, (0.0, FORCE))
    beam = skmpm.Body(points, skmpm.LinearElastic(E, NU, density=1000.0))
    scene, scheme = skmpm.Scene([beam], cell=CELL, supports=[clamp], loads=[pull]), skmpm.Scheme(inertia=False)
    print(skmpm.preflight(scene, dt=1.0, scheme=scheme))
    state = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), 1.0, scheme=scheme)
    print(f"reaction {state.support_force[0]} N/m, {state.report.newton} solve")
    axes = plt.figure(figsize=(7, 2.2), layout="constrained").add_subplot()
    skmpm.plot(scene, state, state.stress[0, 0], axes=axes, label="stress xx [Pa]")
    out.mkdir(parents=True, exist_ok=True)
    axes.figure.savefig(out / "cantilever.png", bbox_inches="tight")
    end = points.x[0] == right
    return float(np.interp(bottom + DEPTH / 2, points.x[1, end], (state.x - points.x)[1, end]))


def finite_elements() -> float:
    """The same displacement by quadratic elements on a body-fitted mesh."""
    mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, 65), np.linspace(0, DEPTH, 9))
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0, "right": lambda x: x[0] == LENGTH})
    basis, facets = (kind(mesh, ElementVector(ElementQuad2()), **where)
                     for kind, where in ((Basis, {}), (FacetBasis, {"facets": "right"})))  # fmt: skip
    f = LinearForm(lambda v, w: FORCE / DEPTH * v[1]).assemble(facets)
    u = solve(*condense(linear_elasticity(*lame_parameters(E, NU)).assemble(basis), f, D=basis.get_dofs("left")))
    return float((basis.probes(np.array([[LENGTH], [DEPTH / 2]])) @ u)[1])


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/cantilever"), help="directory of the picture")
    mpm, fem = material_points(options.parse_args().out), finite_elements()
    print(f"end deflection: material points {mpm:.5f} m, finite elements {fem:.5f} m, error {abs(mpm / fem - 1):.2%}")
