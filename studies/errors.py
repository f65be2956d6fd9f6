"""What can go wrong with a study, told apart."""

from __future__ import annotations

import reprlib


class StudyError(ValueError):
    """Bad input: which field, which value, what is allowed.

    Parameters
    ----------
    field : dotted name of the offending input (``"sweep.friction[2]"``)
    value : what was given
    allowed : what would have been accepted, in words
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        field = field.encode("utf-8", "backslashreplace").decode()  # JSON may hold lone surrogates
        super().__init__(f"{field} = {reprlib.repr(value)}: {allowed}")
        self.field = field
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[StudyError], tuple[str, object, str]]:
        return type(self), (self.field, self.value, self.allowed)


class StoreBusy(RuntimeError):
    """Another process is computing into the same directory."""


class GridLost(ConnectionError):
    """The scheduler could not be reached or forgot its tasks; running again computes the rest."""


class StoreFull(RuntimeError):
    """No room is left on the device of the directory; running again computes the rest."""
