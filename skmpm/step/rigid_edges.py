"""What is said of sharp edges of rigid bodies, as those of a flat punch, which indent deformable bodies.

Stress is unbounded there. In plane strain a point of the boundary is an edge of the body.
"""

from __future__ import annotations

import numpy as np

from skmpm.scene import Contacts, Scene

# [cells] Radius of edges that indented 13 of 14 blocks by 40 % of their height without inertia (test_punch).
MIN_EDGE_RADIUS = 0.5


def indenting_edge_message(scene: Scene, contacts: Contacts) -> str:
    """The text on the rigid edge that carries the largest contact force, for error messages; empty if none does.

    Rigid bodies contribute boundary points to contacts only at edges, as the first body of a contact.
    """
    if contacts.gap.size == 0:
        return ""
    k = int(np.argmax(contacts.force[0]))
    first, second = contacts.bodies[:, k].tolist()
    if contacts.force[0, k] <= 0.0 or contacts.point[k] < 0 or second < 0 or scene.deformable[first]:
        return ""
    x, y = contacts.x[:, k]
    return (
        f"; the largest contact force acts on an edge of body {first} at ({x:.6g}, {y:.6g}) m, where stress is"
        f" unbounded and body {second} may snap through: if a smaller dt does not help, use inertia, or round the"
        f" edge by {MIN_EDGE_RADIUS * scene.cell:.4g} m"
    )
