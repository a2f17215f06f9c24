"""A tube from a mesh
==================

A body from a mesh in gmsh's format: a tube is compressed between two plates.

    python examples/from_mesh.py

`skmpm.from_mesh` takes triangles and quadrilaterals of any mesh that meshio reads; nodes and midpoints of
boundary edges become the outline, holes included. The plates move in quasi-static steps. Thin ring (Timoshenko,
Strength of Materials): force = 6.72 E' I / R^3 times the change of diameter, E' = E / (1 - nu^2),
I = thickness^3 / 12.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np

import skmpm

R, THICK, E, NU, CLOSING = 10e-3, 1e-3, 1e6, 0.3, 0.02  # mean radius, thickness [m], [Pa], -, of the mean diameter
AROUND, ACROSS, STEPS = 300, 5, 10


def tube(path: Path) -> meshio.Mesh:
    """Write a mesh of quadrilaterals in gmsh's format, and read it back."""
    angle, radius = 2.0 * np.pi * np.arange(AROUND) / AROUND, R + THICK * np.linspace(-0.5, 0.5, ACROSS + 1)
    points = [np.outer(radius, f(angle)).ravel() for f in (np.cos, np.sin, np.zeros_like)]
    number = np.arange(points[0].size).reshape(ACROSS + 1, AROUND)
    ahead = np.roll(number, -1, axis=1)
    cells = np.stack([number[:-1], number[1:], ahead[1:], ahead[:-1]], axis=-1).reshape(-1, 4)
    tags = {f"gmsh:{kind}": [np.ones(len(cells), dtype=int)] for kind in ("physical", "geometrical")}
    mesh = meshio.Mesh(np.stack(points, axis=1), [("quad", cells)], cell_data=tags)
    meshio.write(path, mesh, file_format="gmsh22", binary=False)
    return meshio.read(path)


def main(out: Path) -> tuple[float, float]:
    """Force on a plate [N/m]: measured, and of the thin ring."""
    out.mkdir(parents=True, exist_ok=True)
    body = skmpm.Body(skmpm.from_mesh(tube(out / "tube.msh")), skmpm.NeoHookean(E, NU, density=1100.0))
    top, speed = R + THICK / 2, CLOSING * R / STEPS  # of each plate, in steps of 1 s
    plates = [skmpm.Wall((0.0, -y * top), (0.0, y), velocity=(0.0, y * speed), friction=0.3) for y in (1.0, -1.0)]
    scene, scheme = skmpm.Scene([body], cell=THICK / 6, walls=plates), skmpm.Scheme(inertia=False)
    print(skmpm.preflight(scene, 1.0, scheme=scheme))
    *_, state = skmpm.simulate(scene, dt=1.0, until=float(STEPS), scheme=scheme)
    force = float(state.wall_force[1, 1])
    closed = 2 * top - np.ptp(state.walls[:, 1])
    ring = 6.72 * E / (1.0 - NU**2) * THICK**3 / 12.0 / R**3 * closed
    print(f"plates {1e3 * closed:.2f} mm closer: {force:.4g} N/m, thin ring {ring:.4g} N/m")
    axes = plt.figure(figsize=(5, 4), layout="constrained").add_subplot()
    skmpm.plot(scene, state, axes=axes)
    axes.figure.savefig(out / "from_mesh.png", bbox_inches="tight")
    return force, ring


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/from_mesh"), help="directory of mesh and picture")
    main(options.parse_args().out)
