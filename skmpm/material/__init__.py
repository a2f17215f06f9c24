"""Materials are functions of the deformation gradient alone; the rest is built on them once, for any material.

`law` is the interface, `memory` that of materials with internal variables, which are such functions in one step.
`anchored` refers a material to a deformed, stressed anchor configuration, `dilatation` adds the mean dilatation of
cells, `response` is both in one pass, `viscous` adds Kelvin-Voigt viscosity; `check` compares the functions of a
material with each other.
"""

from skmpm.material import dilatation
from skmpm.material.anchored import Anchored
from skmpm.material.check import check_material
from skmpm.material.elastic import LinearElastic, NeoHookean
from skmpm.material.elastoplastic import ElastoPlastic
from skmpm.material.invariants import Hyperelastic
from skmpm.material.law import (
    Isotropic,
    Material,
    Rigid,
    bounded_modulus,
    determinant,
    inverse,
    is_linear,
    poisson_ratio,
    product,
    viscosity_of,
    wave_speed,
    youngs_modulus,
)
from skmpm.material.memory import InStep, MaterialWithMemory, has_memory, in_step, initial_state, virgin
from skmpm.material.requirements import lacking
from skmpm.material.response import Response, response
from skmpm.material.rubber import MooneyRivlin, Ogden, Yeoh
from skmpm.material.viscous import Viscous

__all__ = [
    "Anchored",
    "ElastoPlastic",
    "Hyperelastic",
    "InStep",
    "Isotropic",
    "LinearElastic",
    "Material",
    "MaterialWithMemory",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "Response",
    "Rigid",
    "Viscous",
    "Yeoh",
    "bounded_modulus",
    "check_material",
    "determinant",
    "dilatation",
    "has_memory",
    "in_step",
    "initial_state",
    "inverse",
    "is_linear",
    "lacking",
    "poisson_ratio",
    "product",
    "response",
    "virgin",
    "viscosity_of",
    "wave_speed",
    "youngs_modulus",
]
