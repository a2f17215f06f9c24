"""Checkpoints (`save`, `load`) and time series for ParaView (`record`)."""

from skmpm.io.checkpoint import CheckpointError, load, save, writable
from skmpm.io.paraview import Recorder, record

__all__ = ["CheckpointError", "Recorder", "load", "record", "save", "writable"]
