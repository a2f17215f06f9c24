"""Checkpoints and ParaView time series."""

from pathlib import Path

from skmpm.scene import State


def save(path: str | Path, state: State) -> None:
    """Placeholder until written."""
    raise NotImplementedError
