"""How objects are shown at a prompt and in a notebook: in one line, or as a small table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def line(name: str, facts: Mapping[str, object]) -> str:
    """One line: the name, and pairs of key and value."""
    return f"{name}({', '.join(f'{key} {value}' if key else str(value) for key, value in facts.items())})"


def table(name: str, facts: Mapping[str, object]) -> str:
    """The same as a table in HTML."""
    rows = "".join(f"<tr><td>{escape(key)}</td><td>{escape(str(value))}</td></tr>" for key, value in facts.items())
    return f"<table><caption>{escape(name)}</caption>{rows}</table>"


def with_shapes(of: DataclassInstance) -> str:
    """One line for a dataclass: its fields, arrays by their shapes."""
    facts = ", ".join(f"{f.name}={_short(getattr(of, f.name))}" for f in fields(of) if f.repr)
    return f"{type(of).__name__}({facts})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<{value.dtype} {value.shape}>"
    if isinstance(value, dict):
        return f"<{', '.join(map(str, value))}>"
    if isinstance(value, tuple) and (len(value) > 3 or any(isinstance(item, np.ndarray) for item in value)):
        return f"<{len(value)} of {type(value[0]).__name__}>"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)
