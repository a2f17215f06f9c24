"""Observables of a state: solid fraction, shapes and stress of packings, their contact network, contact tractions."""

from skmpm.observe.bodies import PerBody
from skmpm.observe.observables import Observables, observe
from skmpm.observe.pair_correlation import pair_correlation
from skmpm.observe.pairs import Network, force_lines, network
from skmpm.observe.regions import between_walls
from skmpm.observe.springs import spring_forces
from skmpm.observe.traction import Traction, contact_pressure
from skmpm.observe.wetted import wetted, wetted_segments, with_fluids

__all__ = [
    "Network",
    "Observables",
    "PerBody",
    "Traction",
    "between_walls",
    "contact_pressure",
    "force_lines",
    "network",
    "observe",
    "pair_correlation",
    "spring_forces",
    "wetted",
    "wetted_segments",
    "with_fluids",
]
