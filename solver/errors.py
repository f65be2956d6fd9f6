"""The exceptions of this package."""

from __future__ import annotations

from typing import Any


class SolverError(Exception):
    """Base class of the errors that this package raises."""


def plain(value: Any) -> object:
    """Return a value as messages show it: NumPy numbers become plain numbers."""
    is_number = hasattr(value, "dtype") and getattr(value, "ndim", 1) == 0
    return value.item() if is_number else value


class ModelError(SolverError, ValueError):
    """Bad input; the message states the field, the value and what is allowed.

    Parameters
    ----------
    field : name of the input, dotted if nested (``"material.yield_stress"``)
    value : the given value
    allowed : description of allowed values
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        value = plain(value)
        super().__init__(f"{field} = {value!r}: {allowed}")
        self.field = field
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[ModelError], tuple[str, object, str]]:
        return type(self), (self.field, self.value, self.allowed)


class NotConverged(SolverError):
    """The iteration failed although an equilibrium may exist.

    ``reached`` is the time at the end of the last converged increment, ``attempted`` that of the
    increment that failed. Without amplitudes the time is the load factor.
    """

    def __init__(self, message: str, reached: float = 0.0, attempted: float = 0.0) -> None:
        super().__init__(message)
        self.reached = reached
        self.attempted = attempted

    def __reduce__(self) -> tuple[type[NotConverged], tuple[str, float, float]]:
        return type(self), (str(self), self.reached, self.attempted)


class WindowTooSmall(NotConverged):
    """The plastic zone or the contact of a steady pass reaches the edge of its mesh."""


class NoContact(NotConverged):
    """The contact problem has no solution for this shape of the surfaces, but may for another."""


class Runaway(NotConverged):
    """Plastic strain grows far beyond small strains, though the material hardens."""


class TooLong(NotConverged):
    """A search has used all the work allowed to it; the message says how to make it easier."""


class LimitLoad(NotConverged):
    """No equilibrium exists above the load ``reached``: a body flows plastically, or slides."""


class Spins(LimitLoad):
    """Moment or lateral force of a wheel exceed the friction of its whole contact, which slips."""
