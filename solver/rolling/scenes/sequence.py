"""A sequence of passes with different loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from solver.errors import ModelError
from solver.parameters import is_number

_TIMES = "times"
_MOST = 1000
"""Largest number of passes of a sequence, as of a run."""


def block_of(
    parameters: Any, sequence: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> tuple[Any, ...]:
    """Return the parameters of each pass of a sequence; passes of one entry share an object.

    Parameters
    ----------
    parameters : of the run; they are those of a pass unless its entry gives others
    sequence : a table for each entry
    names : parameters that may differ from pass to pass

    Raises
    ------
    ModelError
        naming the entry and its field, if a parameter is wrong or cannot differ between passes
    """
    block: list[Any] = []
    for number, entry in enumerate(sequence):
        own: dict[str, Any] = dict(entry)
        try:
            times = _times(own.pop(_TIMES, 1))
            for name, value in own.items():
                if name not in names:
                    raise ModelError(name, value, f"must be one of {', '.join(names)}, {_TIMES}")
            block += [replace(parameters, sequence=(), **own)] * times
            if len(block) > _MOST:
                raise ModelError(_TIMES, times, f"must make at most {_MOST} passes in all")
        except ModelError as error:
            field = f"sequence[{number}].{error.field}"
            raise ModelError(field, error.value, error.allowed) from None
    return tuple(block)


def _times(value: Any) -> int:
    """Return the number of passes of an entry."""
    if not is_number(value) or not 1 <= value <= _MOST or value != int(value):
        raise ModelError(_TIMES, value, f"must be an integer from 1 to {_MOST}")
    return int(value)
