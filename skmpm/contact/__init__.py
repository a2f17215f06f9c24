"""Contact formulations: the constraints, gaps and friction of all contacts, for the solver `coulomb`.

A contact formulation is a function (scene, state, body grids, dt, theta, motions, inertia) -> linearise. It is called
at the start of a step with the prescribed velocities `motions`, in static steps (`inertia` False) again after solves.
`linearise(w)` returns the `Constraints` linearised about the nodal velocity w (2 nodes,) [m/s]; where forces drive
anything it is called with all prescribed velocities, too, `linearise(w, motions)`. `point_to_curve` is the default;
`shared_grid` is that of Nezamabadi et al. (2017). A formulation with an attribute `at_grid_nodes` that is true acts
at grid nodes, any other between outlines (`acts_at_grid_nodes`). The contact law is the same for all: Signorini's
condition and Coulomb's friction.

Words of this package: of two bodies in contact, the first one is the secondary (slave) body, whose boundary points
or corners are projected; the second one is the primary (master) body or a wall, on whose boundary their feet lie. A
corner is convex or re-entrant (a notch); corners divide an outline into sides, which are smooth curves. A foot
beyond the end of a side lies beside it. The wedge of two convex corners is the part of their Minkowski difference at
the tip. Contacts are detected up to a distance, the reach, and kept from step to step by their keys.
"""

from skmpm.contact.boundary import point_to_curve
from skmpm.contact.constraints import Constraints, ContactFormulation, Linearise, acts_at_grid_nodes
from skmpm.contact.grid_nodes import shared_grid

__all__ = [
    "Constraints",
    "ContactFormulation",
    "Linearise",
    "acts_at_grid_nodes",
    "point_to_curve",
    "shared_grid",
]
