"""What one run gives: labelled numpy arrays, ready to become a data set."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np


class Status(Enum):
    """Outcome of a run; the text is advice."""

    OK = "the run converged and passed its audit"
    LIMIT_LOAD = "no equilibrium at this load: lower load_ratio or let the material harden"
    NOT_CONVERGED = "an increment did not converge: reduce load_step or refine the mesh"
    AUDIT_FAILED = "converged, but the audit found a violated condition: see the message"

    @property
    def code(self) -> int:
        """Position in the enumeration: the flag value stored in data sets."""
        return list(Status).index(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One run of a scene, in N, mm, MPa.

    Attributes
    ----------
    parameters : the scene's parameter object of exactly this run
    status, message : outcome, and the reason when it is not ``OK``
    coordinates : dimension name -> values, floats (``x``, ``y``, ``depth``, ``s``, ``station``)
        or labels (``component``, ``stage``, ``body``)
    fields : variable name -> (dimension names, values); NaN outside the bodies
    scalars : variable name -> number, audit figures included
    """

    parameters: object
    status: Status
    message: str = ""
    coordinates: Mapping[str, np.ndarray] = field(default_factory=dict)
    fields: Mapping[str, tuple[tuple[str, ...], np.ndarray]] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)
