"""Variables of which a run has one number: a study may choose its runs by them."""

from __future__ import annotations

from typing import Any

from solver.results.quantities import QUANTITIES, Quantity
from solver.scenes import Scene
from studies.errors import StudyError, nearest


def number_of_a_run(field: str, name: Any, scene: Scene) -> Quantity:
    """Return the quantity of this name.

    Raises
    ------
    StudyError
        naming ``field``, if there is none, or if it has dimensions
    """
    quantities = QUANTITIES | {each.name: each for each in scene.quantities}
    quantity = quantities.get(name) if isinstance(name, str) else None
    if quantity is not None and not quantity.dims:
        return quantity
    what = "is no variable" if quantity is None else f"is over {', '.join(quantity.dims)}"
    numbers = [own for own, each in quantities.items() if not each.dims]
    allowed = f"{what}: must be a variable with one number a run{nearest(name, numbers)}"
    raise StudyError(field, name, allowed)
