"""
A rubber seal from gmsh
=======================

A hollow rubber seal is pressed by a plate: a mesh from gmsh, a foot that is glued to the housing,
friction on the plate, and the pressure with which it seals.
"""

# %%
# From mesh to points
# -------------------
# ``seal.geo`` describes the cross section; ``gmsh -2 seal.geo`` makes ``seal.msh``, which meshio
# reads. `from_mesh` puts material points into the triangles; the boundary, hole included, becomes
# the outline on which contact acts. Edges of the mesh should be about 1.2 cells long. The file is
# in millimetres.

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np

import skmpm

MM = 1e-3
mesh = meshio.read(Path(sys.argv[0]).with_name("seal.msh"))  # beside this script
mesh.points *= MM
points = skmpm.from_mesh(mesh)
print(points.size, "points;", len(points.outline), "loops of the outline")

# %%
# The scene
# ---------
# A rubber that stiffens at large strains (Yeoh's law). The foot is glued to the housing: a
# `Support` prescribes the velocity, here zero, of the points within 0.1 mm of the bottom. The plate
# comes down by 3.6 mm in 90 steps without inertia. The check warns of the wall of 4.5 cells, which
# bends some percent too little where it is inclined to the grid.

rubber = skmpm.Yeoh(c10=0.4e6, c20=-0.02e6, c30=0.01e6, bulk=20e6, density=1100.0)
scene = skmpm.Scene(
    [skmpm.Body(points, rubber)],
    cell=0.29 * MM,
    walls=[skmpm.Wall((0.0, 10.0 * MM), (0.0, -1.0), velocity=(0.0, -3.6 * MM), friction=0.3)],
    supports=[skmpm.Support(lambda x: x[1] < 0.1 * MM)],
    friction=0.3,
)
scheme = skmpm.Scheme(inertia=False)
print(skmpm.preflight(scene, dt=1.0 / 90, scheme=scheme))

# %%
# Pressing
# --------

states = list(skmpm.simulate(scene, dt=1.0 / 90, until=1.0, scheme=scheme))
figure, axes = plt.subplots(1, 3, figsize=(10, 3.6), layout="constrained")
for axis, k in zip(axes, (29, 59, 89), strict=True):
    skmpm.plot(scene, states[k], "mises", axes=axis, limits=(0.0, 1.5e6), legend=k == 89)
    axis.set_title(f"{3.6 * states[k].t:.1f} mm")

# %%
# A hollow seal is soft over a long stroke: that is its purpose. Pressed further, the rubber creases
# at both sides of the cavity; a step then fails, and says where. Forces are per metre of length:
# for a ring, multiply them by its circumference. Its section must be small beside its radius.

axes = plt.figure(figsize=(6, 3), layout="constrained").add_subplot()
axes.plot([3.6 * s.t for s in states], [1e-3 * s.wall_force[0, 1] for s in states])
axes.set(xlabel="stroke [mm]", ylabel="force [kN/m]")

# %%
# Does it seal?
# -------------
# A seal that keeps its shape holds a fluid as long as the peak of the contact pressure exceeds the
# pressure of the fluid. `contact_pressure` gives it along the boundary.

axes = plt.figure(figsize=(6, 3), layout="constrained").add_subplot()
for k in (29, 59, 89):
    traction = skmpm.contact_pressure(scene, states[k], 0)
    top = np.flatnonzero(traction.x[1] > states[k].walls[0, 1] - 0.3 * MM)
    top = top[np.argsort(traction.x[0, top])]
    axes.plot(
        1e3 * traction.x[0, top], 1e-6 * traction.pressure[top], label=f"{3.6 * states[k].t:.1f} mm"
    )
axes.set(xlabel="x [mm]", ylabel="pressure on the plate [MPa]")
axes.legend()

# %%
# A fluid that finds its way
# --------------------------
# The fluid also pushes on the seal. A `Pressure` that `penetrates` acts on the boundary from where
# it begins up to contacts that press more than it does. `wetted` says how far it has come. Here it
# begins at the left side and rises until it has passed the plate. Steps have inertia, since a seal
# that gives way has no equilibrium near.

from dataclasses import replace

soft = replace(rubber, viscosity=2e3)
figure, axes = plt.subplots(1, 3, figsize=(10, 3.6), layout="constrained")
for axis, k in zip(axes, (29, 59, 89), strict=True):
    begin = states[k].t
    fluid = skmpm.Pressure(
        lambda x: x[0] < -4.0 * MM, lambda t, begin=begin: 4e5 * (t - begin), penetrates=True
    )
    flooded = replace(
        scene,
        bodies=[skmpm.Body(points, soft)],
        walls=[replace(scene.walls[0], velocity=(0.0, 0.0))],
        loads=[fluid],
    )
    start = skmpm.at_rest(flooded, skmpm.continued(scene, states[k], flooded))
    for state in skmpm.simulate(flooded, until=begin + 1.0, start=start, warn=False):
        (wet,) = skmpm.wetted(flooded, state)
        if wet.size and state.x[0, wet].max() > 4.0 * MM:
            break
    skmpm.plot(flooded, state, "mises", axes=axis, limits=(0.0, 1.5e6), legend=k == 89)
    axis.plot(*state.x[:, wet], "c.", zorder=10)
    axis.set_title(f"{3.6 * begin:.1f} mm: leaks at {1e-6 * fluid.value(state.t):.2f} MPa")

# %%
# The fluid pushes the hollow seal aside long before it exceeds the peak of the contact pressure.
# More compression helps. The wetted boundary is drawn in blue.
