"""What a solution must satisfy, checked after the fact and by other means than solved it.

Taken from the solver as they are: meshes, supports, the chains of edges of contact surfaces, the
displacements of condensed bodies. `plain` evaluates bodies without the solver's operators, `law`
states what a law demands instead of solving it, `surfaces` measures contact on the deformed bodies;
`bodies`, `pairs` and `forces` make figures of them, and `report` holds these against their limits.
"""

from __future__ import annotations

from solver.results.audit.cut import cut_force
from solver.results.audit.figures import AUDIT
from solver.results.audit.report import Audit, audit

__all__ = ["AUDIT", "Audit", "audit", "cut_force"]
