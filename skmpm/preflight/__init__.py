"""Before a run: a summary of the scene with warnings, and the resolution for a wanted error."""

from skmpm.preflight.explain import explain
from skmpm.preflight.limits import PreflightWarning
from skmpm.preflight.suggest import Suggestion, suggest
from skmpm.preflight.summary import Preflight, preflight

__all__ = ["Preflight", "PreflightWarning", "Suggestion", "explain", "preflight", "suggest"]
