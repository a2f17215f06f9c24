"""Tables: frozen dataclasses whose fields are arrays with one entry per item along the last axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Table = TypeVar("Table", bound=DataclassInstance)


def joined(parts: Sequence[Table]) -> Table:
    """Concatenate the items of several tables of the same type."""
    names = [f.name for f in fields(parts[0])]
    columns = {name: np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names}
    return type(parts[0])(**columns)


def among(table: Table, chosen: NDArray[Any]) -> Table:
    """Select items of a table by indices or a mask."""
    return type(table)(**{f.name: getattr(table, f.name)[..., chosen] for f in fields(table)})
