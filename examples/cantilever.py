"""A clamped beam with an end load, by material points and by scikit-fem's finite elements on a fitted mesh.

The grid lies anywhere, here 0.3 cells beside the beam; the support holds its boundary points all the same.
"""

import numpy as np
from skfem import Basis, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad, condense, solve
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skmpm

LENGTH, DEPTH, FORCE, CELL = 8.0, 1.0, -100.0, 0.125
E, NU = 1e6, 0.3


def material_points():
    """Displacement of the middle of the loaded end [m]."""
    points = skmpm.box((0.3 * CELL, 0.3 * CELL), (LENGTH, DEPTH), spacing=CELL / 3)
    left, bottom = points.x.min(axis=1)
    beam = skmpm.Body(points, skmpm.LinearElastic(E, NU, density=1000.0))
    scene = skmpm.Scene(
        [beam],
        cell=CELL,
        supports=[skmpm.Support(lambda x: x[0] == left)],
        loads=[skmpm.Load(lambda x: x[0] == left + LENGTH, (0.0, FORCE))],
    )
    scheme = skmpm.Scheme(inertia=False)
    print(skmpm.preflight(scene, dt=1.0, scheme=scheme))
    state = skmpm.step(scene, skmpm.initial(scene, scheme=scheme), 1.0, scheme=scheme)
    end = points.x[0] == left + LENGTH
    print(f"reaction {state.support_force[0]} N/m, linear solver: one factorisation, {state.report.newton} solve")
    return np.interp(bottom + DEPTH / 2, points.x[1, end], (state.x - points.x)[1, end])


def finite_elements():
    """The same by quadratic elements."""
    mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, 65), np.linspace(0, DEPTH, 9))
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0, "right": lambda x: x[0] == LENGTH})
    basis = Basis(mesh, ElementVector(ElementQuad2()))
    K = linear_elasticity(*lame_parameters(E, NU)).assemble(basis)
    pull = LinearForm(lambda v, w: FORCE / DEPTH * v[1])
    f = pull.assemble(FacetBasis(mesh, ElementVector(ElementQuad2()), facets="right"))
    u = solve(*condense(K, f, D=basis.get_dofs("left")))
    return (basis.probes(np.array([[LENGTH], [DEPTH / 2]])) @ u)[1]


if __name__ == "__main__":
    mpm, fem = material_points(), finite_elements()
    print(f"end deflection: material points {mpm:.5f} m, finite elements {fem:.5f} m, apart {abs(mpm / fem - 1):.2%}")
