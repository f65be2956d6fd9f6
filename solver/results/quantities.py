"""Declarations of the variables in a record: name, meaning, unit, dimensions.

The module that computes a variable declares it when it is imported. The data set, the captions of
pictures and the pages read the declarations. `solver.shipped` lists the declaring modules; they are
imported when an unknown name is requested.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from importlib import import_module
from typing import Any

import numpy as np

from solver.tensors import AXES


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A variable or a coordinate.

    Attributes
    ----------
    name : name of the variable; a coordinate is a variable over the dimension of its name
    long_name : meaning in words
    units : unit in the notation of the CF conventions
    dims : names of the dimensions; empty for one number per run
    standard_name : standard name of the CF conventions, if there is one
    count : whether it is a whole number
    flags : enumeration of its values, if they stand for words
    beside : further attributes of the CF conventions
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
        """Whether it is the coordinate of a dimension."""
        return self.dims == (self.name,)

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the variable by the CF conventions."""
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
        """Return the quantity with one more dimension in front."""
        return replace(self, dims=(dimension, *self.dims))

    def at(self, *dims: str) -> Quantity:
        """Return the same quantity with other dimensions."""
        return replace(self, dims=dims)


class Quantities(Mapping[str, Quantity]):
    """Quantities by name, also those of modules that are not imported yet."""

    def __init__(self) -> None:
        self.known: dict[str, Quantity] = {}

    def __getitem__(self, name: str) -> Quantity:
        """Return a quantity; if it is unknown, import all declaring modules first."""
        return (self.known if name in self.known else self._all)[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of all quantities."""
        return iter(self._all)

    def __len__(self) -> int:
        """Return the number of all quantities."""
        return len(self._all)

    @property
    def _all(self) -> dict[str, Quantity]:
        for module in DECLARING:
            import_module(module)
        return self.known


DECLARING: list[str] = []
"""Modules that declare quantities when they are imported."""
QUANTITIES = Quantities()
IN_SPACE = Quantities()
"""Quantities along the third axis, of runs in three dimensions. Other scenes may use their names
for parameters, axes of a sweep and requested numbers."""


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
    ValueError
        if the name is declared already
    """
    if name in QUANTITIES.known:
        known = QUANTITIES[name].long_name
        raise ValueError(f"{name} is declared already, as {known!r}: choose another name")
    QUANTITIES.known[name] = Quantity(
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


def declare_along(
    name: str, long_name: str, units: str = "1", *, dims: tuple[str, ...] = ()
) -> tuple[Quantity, ...]:
    """Declare a variable for each axis and return all of them; see `along_axes`.

    Parameters
    ----------
    name, long_name : templates with ``{}`` for the name of the axis
    """
    *plane, third = ((name.format(axis), long_name.format(axis)) for axis in AXES)
    return *(declare(*each, units, dims=dims) for each in plane), in_space(*third, units, dims=dims)


def in_space(name: str, long_name: str, units: str, **more: Any) -> Quantity:
    """Return a quantity along the third axis, see `IN_SPACE`; arguments are those of `Quantity`."""
    IN_SPACE.known[name] = Quantity(name=name, long_name=long_name, units=units, **more)
    return IN_SPACE[name]


def placed(prefix: str, *names: str) -> dict[str, str]:
    """Return the attribute ``coordinates`` of a variable with the positions ``PREFIX_NAME``."""
    return {"coordinates": " ".join(f"{prefix}_{name}" for name in names)}


def along_axes(quantities: tuple[Quantity, ...], values: Any) -> dict[Quantity, Any]:
    """Return the values (n_axes, ...) by the quantities of `declare_along`, axis by axis."""
    return dict(zip(quantities, values, strict=False))
