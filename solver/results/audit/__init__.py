"""Checks of a solution by other means than those that solved it.

Taken from the solver without a check: meshes, supports, the chains of edges of contact surfaces,
the displacements of condensed bodies. `plain` evaluates bodies without the solver's operators,
`law` repeats an increment in smaller steps, `surfaces` measures contact on the deformed bodies;
`bodies`, `pairs` and `forces` make figures of these, and `report` compares them with their limits.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from solver.results.audit.cut import cut_force
    from solver.results.audit.figures import AUDIT
    from solver.results.audit.report import Audit, audit
    from solver.results.audit.steady import audit_pass

_HOMES = {
    "AUDIT": "figures",
    "Audit": "report",
    "audit": "report",
    "audit_pass": "steady",
    "cut_force": "cut",
}

__all__ = ["AUDIT", "Audit", "audit", "audit_pass", "cut_force"]


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: the names of the figures need no solver."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
