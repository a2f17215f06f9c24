"""The table of modules of the architecture page, from the first lines of their docstrings."""

import ast
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "skmpm"
PAGE = Path(__file__).parent / "generated" / "modules.md"


def write():
    """Write the table, package after package from the highest layer down."""
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text("\n".join(["| module | subject |", "|---|---|", *rows()]) + "\n")


def rows():
    """A row for each module, packages first with their own docstrings."""
    for path in sorted(SOURCE.rglob("*.py"), key=_place):
        name = ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix("__init__").removesuffix(".")
        docstring = ast.get_docstring(ast.parse(path.read_text()))
        subject = docstring.split("\n\n")[0].replace("\n", " ").replace("|", "\\|")
        label = f"**`{name or 'skmpm'}`**" if path.name == "__init__.py" else f"`{name}`"
        yield f"| {label} | {subject} |"


def _place(path):
    """Modules of the package itself first, then each package behind its docstring."""
    inside = path.relative_to(SOURCE).parts
    return len(inside) > 1, inside[:-1], path.name != "__init__.py", path.name
