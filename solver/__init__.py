"""Elastic-plastic bodies in frictional contact, and their residual stress.

A `Model` consists of bodies (`Body`: mesh, element, kinematics, `Material`, supports, loads) and
contact pairs (`ContactPair`); a `System` is the discretised model. A `Program` of `Stage`s is its
loading history. A `Walker` solves it increment by increment, with plasticity in the outer iteration
and contact in the inner one, and yields an `Outcome`. `solve` does this for a model of your own and
returns a `Solution`; a `Scene` of `SCENES` yields a `Record` for each run. Units are N, mm, MPa;
tension is positive; y points up.
"""

from __future__ import annotations

from solver.late import front
from solver.version import __version__ as __version__

_HOMES = {
    "Amplitude": "model.amplitude",
    "Audit": "audit.report",
    "Body": "model.body",
    "ContactPair": "model.pairs",
    "Coulomb": "model.friction",
    "derive": "derivatives.of_models",
    "Displacement": "model.loads",
    "InitialStress": "model.loads",
    "LimitLoad": "errors",
    "Link": "model.pairs",
    "Material": "materials.elastic_plastic",
    "Model": "model.model",
    "ModelError": "errors",
    "Moved": "model.rigid",
    "NotConverged": "errors",
    "Outcome": "loading.outcome",
    "PathControl": "loading.program",
    "Pressure": "model.loads",
    "Program": "loading.program",
    "Pushed": "model.rigid",
    "Record": "results.record",
    "RigidBody": "model.rigid",
    "Scene": "scenes",
    "SCENES": "shipped",
    "SingularPoint": "model.singular",
    "Solution": "results.solution",
    "solve": "results.solution",
    "SolverError": "errors",
    "Stage": "loading.program",
    "Status": "results.record",
    "System": "contact.system",
    "Tabulated": "model.tabulated",
    "Temperature": "model.loads",
    "Tolerances": "loading.program",
    "Traction": "model.loads",
    "Walker": "loading.walker",
}

__all__ = list(_HOMES)

# A public name is imported when it is first used.
__getattr__ = front(__name__, _HOMES)
