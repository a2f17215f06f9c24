"""Observables of a state: solid fraction, contact surface, shapes, coordination and stress."""

from skmpm.observe.bodies import PerBody
from skmpm.observe.observables import Observables, observe

__all__ = ["Observables", "PerBody", "observe"]
