"""Before a run: a summary of the scene with warnings, and the resolution for a wanted error."""

from skmpm.preflight.suggest import Suggestion, suggest
from skmpm.preflight.summary import preflight

__all__ = ["Suggestion", "preflight", "suggest"]
