"""The record of a run: labelled numpy arrays, ready to become a data set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache

import numpy as np

from solver.results.mesh_fields import MeshFields


class Status(Enum):
    """Outcome of a run."""

    OK = "the run converged and passed its audit"
    LIMIT_LOAD = "there is no equilibrium at this load"
    NOT_CONVERGED = "an increment did not converge"
    AUDIT_FAILED = "the run converged, but its audit found a violated condition"
    OUTSIDE_THEORY = "the run converged and passed its audit, but strain or sliding is not small"

    @property
    def solved(self) -> bool:
        """Whether the run converged and passed its audit, with or without small strains."""
        return self in (Status.OK, Status.OUTSIDE_THEORY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One run of a scene, in N, mm, MPa.

    Attributes
    ----------
    parameters : the scene's parameter object of this run
    status, message : outcome; if it is not ``OK``, the reason and advice
    coordinates : values by name of dimension: floats (``x``, ``y``, ``depth``, ``s``, ``station``)
        or labels (``component``, ``stage``, ``body``)
    fields : names of dimensions and values by name of variable; NaN outside the bodies
    scalars : numbers by name of variable, including figures of the audit
    symmetric : whether the bodies are one half of a model symmetric about x = 0
    mesh : function that returns the fields at the nodes of a complete run; call it before the next
        run is computed
    state : function that returns the arrays from which a run with a larger value of the branch
        parameter goes on, empty if none can; call it before the next run is computed
    """

    parameters: object
    status: Status
    message: str = ""
    coordinates: Mapping[str, np.ndarray] = field(default_factory=dict)
    fields: Mapping[str, tuple[tuple[str, ...], np.ndarray]] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)
    symmetric: bool = False
    mesh: Callable[[], MeshFields] | None = field(default=None, compare=False)
    state: Callable[[], Mapping[str, np.ndarray]] = field(default=dict, compare=False)

    def with_one_mesh(self) -> Record:
        """Return the record with fields at the nodes computed only once."""
        return self if self.mesh is None else replace(self, mesh=cache(self.mesh))
