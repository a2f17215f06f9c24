"""The groups of the cells of a mesh: physical groups of gmsh, sets of cells, subdomains of scikit-fem."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Ints

if TYPE_CHECKING:
    import meshio

PHYSICAL = "gmsh:physical"
SUBDOMAIN = "skfem:s:"  # begins the names of the cell data in which scikit-fem keeps its subdomains
INTERNAL = ("gmsh:", "skfem:")  # begin the names of sets that are no groups
REST = "other"
ELEMENTARY = re.compile(r"(Line|Surface)\d+")  # sets that gmsh writes to Abaqus files, one for each curve and surface


def cell_groups(mesh: meshio.Mesh, kinds: Sequence[str]) -> tuple[list[str], list[Ints]]:
    """Names of the groups, and the group of each cell by type of cell (cells,); no names without groups."""
    blocks = [(k, block) for kind in kinds for k, block in enumerate(mesh.cells) if block.type == kind]
    names = [np.full(len(block.data), "", dtype=object) for _, block in blocks]
    for (k, _), name in zip(blocks, names, strict=True):
        name[:] = _physical(mesh, k, name.size) if PHYSICAL in mesh.cell_data else _smallest_set(mesh, k, name.size)
    every = np.concatenate(names).astype(str)
    if not (every != "").any():
        known, number = np.empty(0, dtype=str), np.zeros(every.size, dtype=np.int64)
    else:
        known, number = np.unique(np.where(every == "", REST, every), return_inverse=True)
    ends = np.cumsum([0] + [sum(len(b.data) for _, b in blocks if b.type == kind) for kind in kinds])
    parts = [number[first:last] for first, last in pairwise(ends.tolist()) if last > first]
    return known.tolist(), parts


def _physical(mesh: meshio.Mesh, k: int, size: int) -> NDArray[Any]:
    """Names of the physical groups of the cells of block k: of surfaces, or their numbers; 0 is none."""
    names = {int(tag): name for name, (tag, dimension) in mesh.field_data.items() if dimension == 2}
    tags = np.asarray(mesh.cell_data[PHYSICAL][k], dtype=np.int64).reshape(size)
    return np.array([names.get(tag, str(tag) if tag else "") for tag in tags.tolist()], dtype=object)


def _smallest_set(mesh: meshio.Mesh, k: int, size: int) -> NDArray[Any]:
    """Names of the smallest sets that the cells of block k belong to."""
    masks = {name[len(SUBDOMAIN) :]: data for name, data in mesh.cell_data.items() if name.startswith(SUBDOMAIN)}
    sets = {name: data for name, data in mesh.cell_sets.items() if not name.startswith(INTERNAL)}
    found = np.full(size, "", dtype=object)
    chosen: list[tuple[int, str, NDArray[Any]]] = [
        (sum(int(np.count_nonzero(d)) for d in data), name, np.asarray(data[k]) != 0) for name, data in masks.items()
    ]
    for name, data in sets.items():
        index, cells = np.zeros(size, dtype=bool), np.zeros(0) if len(data) <= k or data[k] is None else data[k]
        if len(data) != len(mesh.cells) or np.max(cells, initial=-1) >= size:
            raise ValueError(
                f"the set {name!r} has cells that the mesh has not; in an Abaqus file give numbers of elements after"
                " *ELSET, for meshio mixes up names of sets and the ELSET of several *ELEMENT"
            )
        index[np.asarray(cells, dtype=np.int64)] = True
        chosen.append((sum(np.size(d) for d in data if d is not None), name, index))
    for _, name, inside in sorted(chosen, key=lambda one: (not ELEMENTARY.fullmatch(one[1]), -one[0], one[1])):
        found[inside.reshape(size)] = name
    return found
