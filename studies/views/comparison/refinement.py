"""Sizes that a scene's results converge with: its axes of refinement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from solver.results.quantities import QUANTITIES
from solver.scenes import Scene
from studies.definition.parameters import Parameter, defaults, parameters_of

_HALVINGS = 4.0
"""Two halvings: an order of convergence needs three sizes, each half of the one before."""

_STEP = "_step"


@dataclass(frozen=True, slots=True)
class Size:
    """An axis of refinement.

    Attributes
    ----------
    name : what the axis is called: the variable that holds the size a run took, where the scene
        lets a run choose (``advance`` for ``advance_step``), else the parameter
    parameter : the parameter that asks for the size
    """

    name: str
    parameter: str

    def of(self, run: xr.Dataset, parameters: Mapping[str, Any]) -> float:
        """Return the size a run took; the size it was asked for where the run does not say."""
        taken = self.name if self.name != self.parameter else None
        return float(run[taken] if taken in run.data_vars else parameters[self.parameter])


def sizes_of(scene: Scene) -> tuple[Size, ...]:
    """Return the sizes among the parameters that refine, in the order the scene declares them.

    A size is a number that can be made smaller again and again and is never zero. A ratio of
    neighbouring sides is none, since it ends at 1, nor is a tolerance that 0 switches off.
    """
    known, usual = parameters_of(scene), defaults(scene, {})
    return tuple(
        Size(_axis(name), name)
        for name, parameter in known.items()
        if name in scene.refining and _shrinks(parameter, usual[name])
    )


def _axis(parameter: str) -> str:
    taken = parameter.removesuffix(_STEP)
    return taken if taken in QUANTITIES else parameter


def _shrinks(parameter: Parameter, usual: Any) -> bool:
    """Tell whether a parameter is a number above zero whose usual value may be halved twice."""
    schema = parameter.schema
    least, above = schema.get("minimum", -1.0), schema.get("exclusiveMinimum", -1.0)
    positive = schema.get("type") == "number" and (least > 0.0 or above >= 0.0)
    return positive and bool(max(least, above) <= usual / _HALVINGS)
