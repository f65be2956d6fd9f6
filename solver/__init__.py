"""Elastic-plastic bodies in frictional contact, and the residual stress they keep.

`Body` (mesh, element, kinematics, `Material`, supports, pressure) and `ContactPair` make a `Model`;
a `System` is the model discretised. A `Program` of `Stage`s is its loading history. A `Walker`
solves it increment by increment, with plasticity in the outer iteration and contact in the inner
one, and gives an `Outcome`. `solve` does this for a model of your own and returns a `Solution`; a
`Scene` of `SCENES` gives a `Record` for each run. Numbers are in N, mm, MPa; tension is positive; y
points up.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from solver.contact.system import System
    from solver.errors import LimitLoad, ModelError, NotConverged, SolverError
    from solver.loading.control import PathControl, Tolerances
    from solver.loading.outcome import Outcome
    from solver.loading.path import Branch, Path
    from solver.loading.program import Program, Stage
    from solver.loading.walker import Walker
    from solver.materials.material import Material
    from solver.model.body import Body
    from solver.model.model import ContactPair, Model
    from solver.results.audit.report import Audit
    from solver.results.record import Record, Status
    from solver.results.solution import Solution, solve
    from solver.scenes import SCENES, Scene

__version__ = "0.1.0"

_HOMES = {
    "Audit": "results.audit.report",
    "Body": "model.body",
    "Branch": "loading.path",
    "ContactPair": "model.model",
    "LimitLoad": "errors",
    "Material": "materials.material",
    "Model": "model.model",
    "ModelError": "errors",
    "NotConverged": "errors",
    "Outcome": "loading.outcome",
    "Path": "loading.path",
    "PathControl": "loading.control",
    "Program": "loading.program",
    "Record": "results.record",
    "Scene": "scenes",
    "SCENES": "scenes",
    "Solution": "results.solution",
    "solve": "results.solution",
    "SolverError": "errors",
    "Stage": "loading.program",
    "Status": "results.record",
    "System": "contact.system",
    "Tolerances": "loading.control",
    "Walker": "loading.walker",
}

__all__ = [
    "SCENES",
    "Audit",
    "Body",
    "Branch",
    "ContactPair",
    "LimitLoad",
    "Material",
    "Model",
    "ModelError",
    "NotConverged",
    "Outcome",
    "Path",
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


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: to name the runs of a study needs no solver."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
