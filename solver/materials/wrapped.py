"""Base of laws that wrap another law and change some of its members."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from solver.materials.law import Law, attribute
from solver.materials.radial_return import LinearHardening
from solver.materials.state import PlasticState
from solver.typing import Array


class Wrapped(Law):
    """A law that takes from the wrapped law all members that a subclass does not define.

    A subclass defines at least `respond`.
    """

    __slots__ = ()

    law: Law

    def flow_stress(self, state: PlasticState) -> Array:
        """Return the flow stress (n_points,) of the wrapped law [MPa]."""
        return self.law.flow_stress(state)

    @property
    def linear_hardening(self) -> LinearHardening | None:
        """None: the response of the law inside is not that of this law."""
        return None


def _forwarded(name: str, member: object) -> Any:
    if isinstance(member, attribute):
        return property(lambda self: getattr(self.law, name), doc=member.__doc__)

    def call(self: Wrapped, *args: Any, **options: Any) -> Any:
        method: Callable[..., Any] = getattr(self.law, name)
        return method(*args, **options)

    call.__name__, call.__doc__ = name, member.__doc__
    return call


for _name, _member in vars(Law).items():
    if not _name.startswith("_") and _name not in {*vars(Wrapped), "respond"}:
        setattr(Wrapped, _name, _forwarded(_name, _member))
