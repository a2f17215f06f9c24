"""skmpm: implicit material point method on scikit-fem with Contact Dynamics, for packings of soft bodies.

Build a `Scene` of `Body`s and `Wall`s, print its `preflight` check, then loop over `simulate(scene, dt=...,
until=...)`; `observe`, `network` and `contact_pressure` evaluate the states it yields, `record` writes them for
ParaView. `sweep` runs the members of an ensemble.
"""

import logging

from skmpm import contact, coulomb, linear, outline
from skmpm.grid import transfer
from skmpm.io import CheckpointError, load, read, record, save
from skmpm.jam import Jam, jam
from skmpm.material import (
    ElastoPlastic,
    LinearElastic,
    Material,
    MaterialWithMemory,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    Rigid,
    Yeoh,
    check_material,
)
from skmpm.moduli import Moduli, moduli
from skmpm.observe import (
    Network,
    Observables,
    Traction,
    contact_pressure,
    network,
    observe,
    pair_correlation,
    spring_forces,
    wetted,
)
from skmpm.packing import Packing, PackingError, packing
from skmpm.plot import animate, plot
from skmpm.points import Points, box, capsule, disc, ellipse, from_mesh, from_outline, joined, polygon, ring, row
from skmpm.preflight import Preflight, PreflightWarning, Suggestion, explain, preflight, suggest
from skmpm.scene import (
    Body,
    Load,
    Periodic,
    Pressure,
    Scene,
    SceneError,
    Spring,
    State,
    StepFailed,
    Support,
    Wall,
    at_rest,
    continued,
)
from skmpm.scheme import Scheme
from skmpm.simulation import run, simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial
from skmpm.sweep import Run, Sweep, SweepError, sweep

__version__ = "0.3.0rc3"

# scikit-fem tells of every assembly at level INFO: not to a caller who asks the root logger for that level only.
if (_skfem := logging.getLogger("skfem")).level == logging.NOTSET:
    _skfem.setLevel(logging.WARNING)

__all__ = [
    "Body",
    "CheckpointError",
    "ElastoPlastic",
    "Jam",
    "LinearElastic",
    "Load",
    "Material",
    "MaterialWithMemory",
    "Moduli",
    "MooneyRivlin",
    "NeoHookean",
    "Network",
    "Observables",
    "Ogden",
    "Packing",
    "PackingError",
    "Periodic",
    "Points",
    "Preflight",
    "PreflightWarning",
    "Pressure",
    "Rigid",
    "Run",
    "Scene",
    "SceneError",
    "Scheme",
    "Spring",
    "State",
    "StepFailed",
    "Suggestion",
    "Support",
    "Sweep",
    "SweepError",
    "Traction",
    "Wall",
    "Yeoh",
    "animate",
    "at_rest",
    "box",
    "capsule",
    "check_material",
    "contact",
    "contact_pressure",
    "continued",
    "coulomb",
    "disc",
    "ellipse",
    "explain",
    "from_mesh",
    "from_outline",
    "initial",
    "jam",
    "joined",
    "linear",
    "load",
    "moduli",
    "network",
    "observe",
    "outline",
    "packing",
    "pair_correlation",
    "plot",
    "polygon",
    "preflight",
    "read",
    "record",
    "ring",
    "row",
    "run",
    "save",
    "simulate",
    "spring_forces",
    "step",
    "suggest",
    "sweep",
    "transfer",
    "wetted",
]
