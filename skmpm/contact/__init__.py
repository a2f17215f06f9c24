"""Who touches where: the rows, gaps and friction of all contacts, for `coulomb` to solve.

A contact law is a function (scene, state, sheets, dt, theta) -> linearise, called once at the start of a step;
`linearise(w)` gives the `Rows` about the nodal velocity w (2 nodes,) [m/s]. `outlines` is the default, `shared_nodes`
the seed's.
"""

from skmpm.contact.nodes import shared_nodes
from skmpm.contact.rims import outlines
from skmpm.contact.rows import ContactLaw, Linearise, Rows, given_velocities

__all__ = ["ContactLaw", "Linearise", "Rows", "given_velocities", "outlines", "shared_nodes"]
