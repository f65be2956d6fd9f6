"""The exceptions of this package."""

from __future__ import annotations


class SolverError(Exception):
    """Base of every error this package raises on purpose."""


class ModelError(SolverError, ValueError):
    """Bad input; the message says which field, which value and what is allowed.

    Parameters
    ----------
    field : name of the offending input, dotted for nested ones (``"material.yield_stress"``)
    value : what was given
    allowed : what would have been accepted, in words
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        super().__init__(f"{field} = {value!r}: {allowed}")
        self.field = field
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[ModelError], tuple[str, object, str]]:
        return type(self), (self.field, self.value, self.allowed)


class NotConverged(SolverError):
    """The iteration failed although an equilibrium may exist.

    ``reached`` is the time of the last converged increment, ``attempted`` that of the increment
    that failed. Time is the load factor where the pressures of the bodies have no amplitude.
    """

    def __init__(self, message: str, reached: float = 0.0, attempted: float = 0.0) -> None:
        super().__init__(message)
        self.reached = reached
        self.attempted = attempted

    def __reduce__(self) -> tuple[type[NotConverged], tuple[str, float, float]]:
        return type(self), (str(self), self.reached, self.attempted)


class WindowTooSmall(NotConverged):
    """A steady pass yields, or touches, as far as its mesh was made for; a larger one may do."""


class NoContact(NotConverged):
    """No contact forces meet the conditions of a contact; on another shape there may be some."""


class LimitLoad(NotConverged):
    """The load cannot grow beyond ``reached``: a body flows plastically, or slides off."""


class Spins(LimitLoad):
    """A wheel is turned by more than its contact bears where all of it slips."""
