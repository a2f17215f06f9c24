"""Checkpoints (`save`, `load`) and time series for ParaView (`record`, `read`)."""

from skmpm.io.checkpoint import PARTIAL, CheckpointError, load, replacing, save, writable
from skmpm.io.reading import Frame, Recording, read
from skmpm.io.recording import Recorder, record

__all__ = [
    "PARTIAL",
    "CheckpointError",
    "Frame",
    "Recorder",
    "Recording",
    "load",
    "read",
    "record",
    "replacing",
    "save",
    "writable",
]
