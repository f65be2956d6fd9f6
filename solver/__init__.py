"""Elastic-plastic bodies in frictional contact, and the residual stress they keep.

`Body` (mesh + element + state + `Material` + supports + pressure) and `ContactPair` make a
`Model`; a `System` is the model discretised; a `Path` walks its load in increments, each solved
with plasticity outside and contact inside, and releases it; a `Solution` or, for the named
`SCENES`, a `Record` is what remains. Numbers are in N, mm, MPa; tension is positive; y is up.
"""

from solver.contact.system import System
from solver.errors import LimitLoad, ModelError, NotConverged, SolverError
from solver.loading.control import PathControl, Tolerances
from solver.loading.outcome import Outcome
from solver.loading.program import Program, Stage
from solver.loading.walker import Walker
from solver.materials.material import Material
from solver.model.body import Body
from solver.model.model import ContactPair, Model
from solver.results.audit import Audit
from solver.results.record import Record, Status
from solver.results.solution import Solution, solve
from solver.scenes import SCENES, Scene

__version__ = "0.1.0"

__all__ = [
    "SCENES",
    "Audit",
    "Body",
    "ContactPair",
    "LimitLoad",
    "Material",
    "Model",
    "ModelError",
    "NotConverged",
    "Outcome",
    "PathControl",
    "Program",
    "Record",
    "Scene",
    "Solution",
    "SolverError",
    "Stage",
    "Status",
    "System",
    "Tolerances",
    "Walker",
    "solve",
]
