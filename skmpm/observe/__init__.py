"""What a packing looks like: solid fraction, contact surface, shapes, coordination and stress of a state."""

from skmpm.observe.bodies import PerBody
from skmpm.observe.observables import Observables, observe

__all__ = ["Observables", "PerBody", "observe"]
