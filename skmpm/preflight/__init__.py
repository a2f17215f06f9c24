"""Preflight: what a scene asks for before time is spent on it, and what resolution an error needs."""

from skmpm.preflight.suggest import Suggestion, suggest
from skmpm.preflight.summary import preflight

__all__ = ["Suggestion", "preflight", "suggest"]
