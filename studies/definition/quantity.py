"""Variables of which a run has one number: a study may choose its runs by them."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

from solver.scenes import Scene
from studies.errors import StudyError, nearest


def number_of_a_run(field: str, name: Any, scene: Scene) -> type[IntEnum] | None:
    """Return the words of the values of a variable; None for numbers.

    Raises
    ------
    StudyError
        naming ``field``, if there is none, or if it has dimensions
    """
    quantities = scene.known_quantities
    quantity = quantities.get(name) if isinstance(name, str) else None
    if quantity is not None and not quantity.dims:
        return quantity.flags
    what = "is no variable" if quantity is None else f"is over {', '.join(quantity.dims)}"
    numbers = [own for own, each in quantities.items() if not each.dims]
    allowed = f"{what}: must be a variable with one number a run{nearest(name, numbers)}"
    raise StudyError(field, name, allowed)
