"""Libraries that only some functions need: imported when these are called."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol


class Table(Protocol):
    """What has columns by name."""

    def table(self) -> dict[str, Any]:
        """The columns."""
        ...


def optional(name: str, user: str, extra: str = "") -> Any:
    """A module; ImportError, with the remedy, where it is not installed.

    `user` is the function that needs it, `extra` the optional dependencies of skmpm that it belongs to, if to any.
    """
    try:
        return import_module(name)
    except ImportError as error:
        module = name.partition(".")[0]
        what = f'"skmpm[{extra}]"' if extra else module
        raise ImportError(f"{user} needs {module}; install it with: pip install {what}") from error


def data_frame(of: Table) -> Any:
    """The table as a `pandas.DataFrame`, a column for each name.

    Raises
    ------
    ImportError
        if pandas is not installed
    """
    return optional("pandas", "to_pandas", "tables").DataFrame(of.table())
