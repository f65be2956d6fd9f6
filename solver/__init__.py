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

from solver.version import __version__ as __version__

if TYPE_CHECKING:
    from solver.contact.system import System
    from solver.errors import LimitLoad, ModelError, NotConverged, SolverError
    from solver.loading.control import PathControl, Tolerances
    from solver.loading.outcome import Outcome
    from solver.loading.program import Program, Stage
    from solver.loading.walker import Walker
    from solver.materials.material import Material
    from solver.model.amplitude import Amplitude
    from solver.model.body import Body
    from solver.model.link import Link
    from solver.model.loads import Displacement, InitialStress, Pressure, Temperature, Traction
    from solver.model.model import ContactPair, Model
    from solver.model.rigid import Moved, Pushed, RigidBody
    from solver.model.singular import SingularPoint
    from solver.model.tabulated import Tabulated
    from solver.results.audit.report import Audit
    from solver.results.record import Record, Status
    from solver.results.solution import Solution, solve
    from solver.scenes import SCENES, Scene

_HOMES = {
    "Amplitude": "model.amplitude",
    "Audit": "results.audit.report",
    "Body": "model.body",
    "ContactPair": "model.model",
    "Displacement": "model.loads",
    "InitialStress": "model.loads",
    "LimitLoad": "errors",
    "Link": "model.link",
    "Material": "materials.material",
    "Model": "model.model",
    "ModelError": "errors",
    "Moved": "model.rigid",
    "NotConverged": "errors",
    "Outcome": "loading.outcome",
    "PathControl": "loading.control",
    "Pressure": "model.loads",
    "Program": "loading.program",
    "Pushed": "model.rigid",
    "Record": "results.record",
    "RigidBody": "model.rigid",
    "Scene": "scenes",
    "SCENES": "scenes",
    "SingularPoint": "model.singular",
    "Solution": "results.solution",
    "solve": "results.solution",
    "SolverError": "errors",
    "Stage": "loading.program",
    "Status": "results.record",
    "System": "contact.system",
    "Tabulated": "model.tabulated",
    "Temperature": "model.loads",
    "Tolerances": "loading.control",
    "Traction": "model.loads",
    "Walker": "loading.walker",
}

__all__ = [
    "SCENES",
    "Amplitude",
    "Audit",
    "Body",
    "ContactPair",
    "Displacement",
    "InitialStress",
    "LimitLoad",
    "Link",
    "Material",
    "Model",
    "ModelError",
    "Moved",
    "NotConverged",
    "Outcome",
    "PathControl",
    "Pressure",
    "Program",
    "Pushed",
    "Record",
    "RigidBody",
    "Scene",
    "SingularPoint",
    "Solution",
    "SolverError",
    "Stage",
    "Status",
    "System",
    "Tabulated",
    "Temperature",
    "Tolerances",
    "Traction",
    "Walker",
    "solve",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: to name the runs of a study needs no solver."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
