"""Contact laws: the constraints, gaps and friction of all contacts, for the solver `coulomb`.

A contact law is a function (scene, state, body grids, dt, theta, motions) -> linearise, called once at the start of a
step with the prescribed velocities `motions`. `linearise(w)` returns the `Constraints` linearised about the nodal
velocity w (2 nodes,) [m/s]. `point_to_curve` is the default; `shared_grid` is that of Nezamabadi et al. (2017). A law
with an attribute `at_grid_nodes` that is true acts at grid nodes, any other between outlines (`acts_at_grid_nodes`).
"""

from skmpm.contact.boundary import point_to_curve
from skmpm.contact.constraints import Constraints, ContactLaw, Linearise, acts_at_grid_nodes
from skmpm.contact.grid_nodes import shared_grid

__all__ = ["Constraints", "ContactLaw", "Linearise", "acts_at_grid_nodes", "point_to_curve", "shared_grid"]
