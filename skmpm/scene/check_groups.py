"""Checks of the materials of a body of several."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from skmpm.material import Rigid
from skmpm.points import Points
from skmpm.scene.objects import SceneError


def check_groups(name: str, points: Points, materials: Mapping[str, object]) -> None:
    """Raise SceneError unless each group of the points has a deformable material, and each material points."""
    if points.group is None:
        raise SceneError(
            f"{name}: materials are given by group, {_listed(materials)}, and its points have no groups; use"
            " points.with_groups(...) or from_mesh of a mesh with physical groups, or give one material"
        )
    known, count = np.unique(points.group, return_counts=True)
    for group, size in zip(known.tolist(), count.tolist(), strict=True):
        if group not in materials:
            raise SceneError(
                f"{name}: group {group!r} of its points, {size} of {points.size}, has no material; there are those of"
                f" {_listed(materials)}"
            )
    for group, material in materials.items():
        if group not in known:
            raise SceneError(
                f"{name}: there is a material of group {group!r}, and its points have the groups"
                f" {_listed(known.tolist())}; correct the name or leave it out"
            )
        if isinstance(material, Rigid):
            raise SceneError(
                f"{name}, group {group!r}: its material is Rigid, which only whole bodies are; use a stiff material,"
                " and to turn it beds with a moving rest, a Spring at each of its boundary points"
            )


def _listed(names: Mapping[str, object] | list[str]) -> str:
    return ", ".join(repr(name) for name in names)
