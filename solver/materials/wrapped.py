"""A law around another one, whose members it passes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from solver.materials.attribute import attribute
from solver.materials.law import Law

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from solver.materials.state import PlasticState

    Array = NDArray[np.float64]


class Wrapped(Law):
    """A law that is another one but for the members that a subclass defines.

    All other members of `Law` are those of the wrapped law. A subclass defines at least `respond`.
    """

    __slots__ = ()

    law: Law

    def flow_stress(self, state: PlasticState) -> Array:
        """Return that of the wrapped law."""
        return self.law.flow_stress(state)

    def in_plane_stress(self) -> Law | None:
        """Return None: in plane stress the whole is wrapped by `PlaneStress`, not the law in it."""
        return None


def _passed_on(name: str, member: object) -> Any:
    if isinstance(member, attribute):
        return property(lambda self: getattr(self.law, name), doc=member.__doc__)

    def call(self: Wrapped, *args: Any, **options: Any) -> Any:
        method: Callable[..., Any] = getattr(self.law, name)
        return method(*args, **options)

    call.__name__, call.__doc__ = name, member.__doc__
    return call


for _name, _member in vars(Law).items():
    if not _name.startswith("_") and _name not in {*vars(Wrapped), "respond"}:
        setattr(Wrapped, _name, _passed_on(_name, _member))
