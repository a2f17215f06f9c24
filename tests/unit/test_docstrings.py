"""What `help` says of public names: sections, fields of results, and energies of materials."""

import inspect
import re
from dataclasses import fields, is_dataclass
from types import FunctionType, GenericAlias, ModuleType

import numpy as np
import pytest

import skmpm
from skmpm.io import Frame, Recorder, Recording
from skmpm.observe import PerBody
from skmpm.scene import Contacts, Energy, Report, StepControl
from skmpm.sweep import Member

MODULES = ("contact", "coulomb", "linear", "outline", "transfer")
NAMES = {
    f"{module}.{name}".removeprefix("skmpm."): thing
    for module in ("skmpm", *MODULES)
    for name in (["to_points"] if module == "transfer" else getattr(skmpm, module, skmpm).__all__)
    if not isinstance(thing := getattr(getattr(skmpm, module, skmpm), name), (int, float, GenericAlias, ModuleType))
}
FUNCTIONS = {name: thing for name, thing in NAMES.items() if not inspect.isclass(thing)}
RESULTS = (Contacts, Energy, Frame, Member, PerBody, Recorder, Recording, Report, StepControl)
CLASSES = {name: thing for name, thing in NAMES.items() if name not in FUNCTIONS}
CLASSES |= {kind.__name__: kind for kind in RESULTS}
OF_MATERIALS = {*dir(skmpm.MaterialWithMemory), "plastic_strain", "stress_zz"}  # described by the two protocols
METHODS = {
    f"{kind}.{name}": thing.__get__(object(), CLASSES[kind])
    for kind in CLASSES
    for name, thing in vars(CLASSES[kind]).items()
    if "." not in kind and name[0] != "_" and isinstance(thing, (classmethod, staticmethod, FunctionType))
    if name not in {*OF_MATERIALS, *getattr(CLASSES[kind], "__dataclass_fields__", ())}
}


def sections(thing):
    """Sections of a docstring by title."""
    _, *parts = re.split(r"^(?=[A-Z]\w+\n-+$)", inspect.getdoc(thing), flags=re.MULTILINE)
    return {title: text for title, _, text in (part.split("\n", 2) for part in parts)}


def described(section):
    """Names that a section describes, in its order."""
    lines = (line for line in section.splitlines() if re.match(r"[\w*][\w*, ]* : ", line))
    return [name for line in lines for name in line.split(" : ")[0].replace("*", "").split(", ")]


@pytest.mark.parametrize("name", sorted(NAMES.keys() | CLASSES.keys() | METHODS.keys()))
def test_a_docstring_can_be_read_alone(name):
    text = inspect.getdoc((NAMES | CLASSES | METHODS)[name])
    assert not text.startswith(("The same", "Those of", "As "))


@pytest.mark.parametrize("name", sorted(FUNCTIONS.keys() | METHODS.keys()))
def test_parameters_and_results_of_a_function_are_described(name):
    """A method without parameters says in its first line what it returns."""
    thing = (FUNCTIONS | METHODS)[name]
    signature, found = inspect.signature(thing), sections(thing)
    assert sorted(described(found.get("Parameters", ""))) == sorted(signature.parameters)
    if signature.return_annotation not in ("None", None) and (signature.parameters or name in FUNCTIONS):
        assert ("Returns" in found) != ("Yields" in found)


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_a_class_describes_its_parameters_or_attributes(name):
    """Fields are among the attributes; protocols are described by members, errors by messages."""
    kind = CLASSES[name]
    if getattr(kind, "_is_protocol", False) or issubclass(kind, (Recorder, ValueError)):
        return
    found = sections(kind)
    assert ("Parameters" in found) != ("Attributes" in found)
    if "Parameters" in found:
        assert sorted(described(found["Parameters"])) == sorted(inspect.signature(kind).parameters)
    elif is_dataclass(kind):
        assert {field.name for field in fields(kind)} <= set(described(found["Attributes"]))


RUBBERS = (
    skmpm.MooneyRivlin(1e5, 2e4, 2e6, 1000.0),
    skmpm.Yeoh(1e5, -1e4, 1e3, 2e6, 1000.0),
    skmpm.Ogden((1e5,), (2.0,), 2e6, 1000.0),
)


@pytest.mark.parametrize("material", RUBBERS, ids=lambda m: type(m).__name__)
def test_the_volumetric_energy_of_rubbers_is_that_of_their_docstrings(material):
    """Equal stretches in all directions are not possible in plane strain: the isochoric energies are subtracted."""
    assert "kappa/4 (J^2 - 1 - 2 ln J)" in type(material).__doc__
    J = 1.3
    F = np.diag([np.sqrt(J), np.sqrt(J)])[:, :, None]
    l = np.array([J**0.5, J**0.5, 1.0]) * J ** (-1 / 3)  # noqa: E741
    first, second = np.sum(l**2) - 3.0, np.sum(l**-2) - 3.0
    iso = {
        "MooneyRivlin": 1e5 * first + 2e4 * second,
        "Yeoh": 1e5 * first - 1e4 * first**2 + 1e3 * first**3,
        "Ogden": 1e5 / 2.0 * first,
    }[type(material).__name__]
    volumetric = 2e6 / 4.0 * (J**2 - 1.0 - 2.0 * np.log(J))
    assert material.energy(F)[0] == pytest.approx(iso + volumetric, rel=1e-12)
