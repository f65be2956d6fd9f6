"""The meaning of each number in a record, declared once, in the module that computes it.

The data set, the captions of pictures and the pages read these declarations. `QUANTITIES` is
complete when `solver.scenes` has been imported.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from enum import IntEnum


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A variable or a coordinate.

    Attributes
    ----------
    name : name of the variable; the only dimension of a coordinate has the same name
    long_name : what it is, in words
    units : as the CF conventions write them
    dims : its dimensions; none for one number per run
    standard_name : name in the CF conventions, where there is one
    count : whether it is a whole number
    flags : enumeration of its values, where they stand for words
    beside : more attributes of the CF conventions
    """

    name: str
    long_name: str
    units: str = "1"
    dims: tuple[str, ...] = ()
    standard_name: str = ""
    count: bool = False
    flags: type[IntEnum] | None = None
    beside: Mapping[str, str] = field(default_factory=dict, hash=False)

    @property
    def coordinate(self) -> bool:
        """Whether it is a dimension's own coordinate."""
        return self.dims == (self.name,)

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes."""
        given = {
            "long_name": self.long_name,
            "units": self.units,
            "standard_name": self.standard_name,
        }
        known: dict[str, Any] = {key: value for key, value in given.items() if value}
        if self.flags is not None:
            known["flag_values"] = np.array(list(self.flags), dtype=np.int32)
            known["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return known | dict(self.beside)

    def over(self, dimension: str) -> Quantity:
        """Return the quantity with one more dimension, before its own."""
        return replace(self, dims=(dimension, *self.dims))

    def at(self, *dims: str) -> Quantity:
        """Return the same quantity at places that have other dimensions."""
        return replace(self, dims=dims)


QUANTITIES: dict[str, Quantity] = {}


def declare(
    name: str,
    long_name: str,
    units: str = "1",
    *,
    dims: tuple[str, ...] = (),
    standard_name: str = "",
    count: bool = False,
    flags: type[IntEnum] | None = None,
    beside: Mapping[str, str] | None = None,
) -> Quantity:
    """Declare a variable or a coordinate, and return it.

    Raises
    ------
    ValueError : the name is declared already
    """
    if name in QUANTITIES:
        known = QUANTITIES[name].long_name
        raise ValueError(f"{name} is declared already, as {known!r}: choose another name")
    QUANTITIES[name] = Quantity(
        name=name,
        long_name=long_name,
        units=units,
        dims=dims,
        standard_name=standard_name,
        count=count or flags is not None,
        flags=flags,
        beside=beside or {},
    )
    return QUANTITIES[name]
