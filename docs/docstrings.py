"""Docstrings of the API reference: sections as definition lists, with the types that signatures annotate.

Docstrings are written as ``name : description`` with shapes and units, and results as a description. Types stand in
signatures only, and are read from the source, where they have their short names.
"""

import ast
import inspect
import re
import textwrap
from functools import cache
from pathlib import Path

PAGES = Path(__file__).parent / "api"
OF_MATERIALS = "lame, energy, stress, tangent"
SHOWN = {  # members of classes that have more, fields or members for the library itself, and inherited ones
    "LinearElastic": OF_MATERIALS,
    **dict.fromkeys(("NeoHookean", "MooneyRivlin", "Yeoh", "Ogden"), f"{OF_MATERIALS}, stress_zz"),
    "ElastoPlastic": f"{OF_MATERIALS}, state0, update, plastic_strain, stress_zz",
    "Run": "",
    "Scene": "offsets, owner, initial_positions, initial_volumes, deformable, outlined, normals",
    "Scheme": "keeps_nodal_velocities, fast, balanced, accurate, nezamabadi2017",
    "Periodic": "box, rate_at, stress_at, components",
    "Preflight": "lines, points, points_per_cell, resolution, across, slit, courant, driven, approach, fall, "
    "touches, unknowns, half_bandwidth, solver, memory, seconds_of_step, seconds",
}
SECTION = re.compile(r"^(?=[A-Z]\w+\n-+$)", re.MULTILINE)
ENTRY = re.compile(r"(\*{0,2}\w+(?:, \*{0,2}\w+)*) : (.*)", re.DOTALL)
WORDS = {
    "Array": "ndarray",
    "ArrayLike": "array_like",
    "Bools": "ndarray of bool",
    "Build": "callable",
    "Callable": "callable",
    "Column": "ndarray",
    "Components": "array_like",
    "ContactFormulation": "callable",
    "Ints": "ndarray of int",
    "Limits": "(float, float)",
    "Linear": "callable",
    "Linearise": "callable",
    "Motion": "callable",
    "NDArray": "ndarray",
    "Names": "ndarray of str",
    "Rest": "float or array_like or callable",
    "Row": "dict",
    "Selection": "ndarray of int or slice",
    "Tensor": "array_like or callable",
    "Value": "float or str",
    "View": "((float, float), (float, float))",
    "Where": "callable",
}
CONTAINERS = {"Iterable": "iterable of", "Sequence": "sequence of", "Iterator": "iterator of"}
LINKS = {
    "Axes": "matplotlib.axes.Axes",
    "LinearOperator": "scipy.sparse.linalg.LinearOperator",
    "Path": "pathlib.Path",
    "SuperLU": "scipy.sparse.linalg.SuperLU",
    "bsr_array": "scipy.sparse.bsr_array",
    "csc_array": "scipy.sparse.csc_array",
    "csr_array": "scipy.sparse.csr_array",
    "ndarray": "numpy.ndarray",
    "skfem.Mesh": "skfem.mesh.Mesh",
}


@cache
def documented():
    """Full names of all that has a page, from the tables of the sections."""
    found, module = [], "skmpm"
    for page in sorted(PAGES.glob("[!i]*.rst")):
        for line in page.read_text().split("\n"):
            if line.startswith((".. currentmodule:: ", ".. automodule:: ")):
                module = line.split(":: ")[1]
            elif name := re.fullmatch(r"   ((?:[a-z]+\.)?\w+)", line):
                found.append(f"{module}.{name[1]}")
    return found


def filenames():
    """Pages of classes whose names differ from those of functions by a capital only, which some file systems drop."""
    lower = [name.lower() for name in documented()]
    classes = [name for name in documented() if name.rpartition(".")[2][0].isupper()]
    return {name: f"{name}-class" for name in classes if lower.count(name.lower()) > 1}


def described(app, what, name, obj, options, lines):
    """Replace the sections of a docstring."""
    text = re.sub(r"`(pandas\.\w+)`", r":py:class:`\1`", "\n".join(lines))
    head, *sections = SECTION.split(text)
    sections = [_section(obj, *section.split("\n", 2)) for section in sections]
    lines[:] = "\n".join([head, *sections]).split("\n")


def signed(app, what, name, obj, options, signature, result):
    """Leave out the signatures of classes that are results, whose docstrings have no parameters."""
    result_only = what in ("class", "exception") and "\nParameters\n---" not in (inspect.getdoc(obj) or "")
    return ("", None) if signature and result_only else None


def _section(obj, title, rule, body):
    """A section as a field that holds a definition list; others with a heading."""
    items = [item.rstrip() for item in re.split(r"\n(?=\S)", body.strip("\n"))]
    if title in ("Parameters", "Attributes"):
        annotations = _annotations(obj)
        items = _named(items, lambda names: [annotations.get(name.strip("*")) for name in names])
    elif title in ("Returns", "Yields"):
        items = _results(items, body, _annotations(obj).get("return"), title == "Yields")
    elif title == "Raises":
        names = (item.partition("\n") for item in items)
        items = [_item(", ".join(f":py:exc:`{n}`" for n in name.split(", ")), text) for name, _, text in names]
    else:
        return f".. rubric:: {title}\n\n{body}"
    return f":{title}:\n\n{textwrap.indent(chr(10).join(items), '    ')}\n"


def _item(term, text):
    """A term and its description."""
    first, _, rest = text.partition("\n")
    return f"{term}\n" + textwrap.indent(f"{first.strip()}\n{textwrap.dedent(rest)}", "    ")


def _named(items, annotations_of):
    """Items of ``name : description`` with the types of the names."""
    found = []
    for names, text in (ENTRY.fullmatch(item).groups() for item in items):
        names = names.split(", ")
        term = ", ".join("**" + name.replace("*", r"\*") + "**" for name in names)
        types = dict.fromkeys(_words(annotation) for annotation in annotations_of(names) if annotation)
        types.pop("Any", None)
        found.append(_item(f"{term} : {_linked(', '.join(types))}" if types else term, text))
    return found


def _results(items, body, annotation, yields):
    """What is returned: a description, or one with a name for each value of a tuple."""
    if yields:
        annotation = annotation.slice
    if not all(map(ENTRY.fullmatch, items)):
        words = _words(annotation)
        return items if words == "Any" else [_item(_linked(words), body.strip())]
    is_tuple = isinstance(annotation, ast.Subscript) and isinstance(annotation.slice, ast.Tuple)
    values = iter(annotation.slice.elts if is_tuple else [annotation])
    return _named(items, lambda names: [next(values) for _ in names])


def _annotations(obj):
    """Annotations by name in the source of a class and its bases or of a function, whose result is "return"."""
    if inspect.isclass(obj):
        found = {}
        for base in reversed([base for base in obj.__mro__ if base.__module__.startswith("skmpm")]):
            for node in _tree(base).body:
                if isinstance(node, ast.AnnAssign):
                    found[node.target.id] = node.annotation
                elif isinstance(node, ast.FunctionDef):
                    found |= _arguments(node) if node.name == "__init__" else {node.name: node.returns}
        return found
    function = getattr(
        obj, "py_func", obj if hasattr(obj, "__code__") or inspect.ismethod(obj) else type(obj).__call__
    )
    node = _tree(inspect.unwrap(function))
    return _arguments(node) | {"return": node.returns}


def _tree(obj):
    return ast.parse(textwrap.dedent(inspect.getsource(obj))).body[0]


def _arguments(node):
    return {each.arg: each.annotation for each in ast.walk(node.args) if isinstance(each, ast.arg)}


def _words(node):
    """An annotation in words."""
    match node:
        case ast.Constant(value=str()):
            return _words(ast.parse(node.value, mode="eval").body)
        case ast.BinOp():
            return " or ".join(dict.fromkeys(f"{_words(node.left)} or {_words(node.right)}".split(" or ")))
        case ast.Subscript(value=ast.Name(id="tuple"), slice=ast.Tuple(elts=[each, ast.Constant()])):
            return f"tuple of {_words(each)}"
        case ast.Subscript(value=ast.Name(id="tuple"), slice=ast.Tuple()):
            return f"({', '.join(map(_words, node.slice.elts))})"
        case ast.Subscript(value=ast.Name(id="Mapping" | "dict")):
            return "dict"
        case ast.Subscript(value=ast.Name(id="AbstractContextManager")):
            return "context manager"
        case ast.Subscript(value=ast.Name(id=name)) if name in CONTAINERS:
            return f"{CONTAINERS[name]} {_words(node.slice)}"
        case ast.Subscript():
            return _words(node.value)
    name = ast.unparse(node)
    short = name if name.startswith(("skfem", "meshio")) else name.rpartition(".")[2]
    return WORDS.get(short, short)


def _linked(words):
    return re.sub(r"[A-Za-z_]\w*(?:\.\w+)*", lambda name: _link(name[0]), words)


def _link(name):
    """A link to a class: one of another library, or the one of this name with the shortest full name."""
    if name in LINKS:
        return f":py:class:`{name} <{LINKS[name]}>`"
    pages = [page for page in documented() if page.rpartition(".")[2] == name]
    return f":py:class:`~{min(pages, key=len)}`" if pages else name
