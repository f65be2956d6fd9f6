"""Checks of a solution by other means than those that solved it.

Taken from the solver without a check: meshes, supports, the chains of edges of contact surfaces,
the displacements of condensed bodies. `plain` evaluates bodies without the solver's operators,
`law` repeats an increment in smaller steps, `surfaces` measures contact on the deformed bodies;
`bodies`, `pairs` and `forces` make figures of these, and `report` compares them with their limits.
"""

from __future__ import annotations

from solver.results.audit.cut import cut_force
from solver.results.audit.figures import AUDIT
from solver.results.audit.report import Audit, audit
from solver.results.audit.steady import audit_pass

__all__ = ["AUDIT", "Audit", "audit", "audit_pass", "cut_force"]
