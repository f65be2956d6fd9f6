"""The runs of a study: cases (one run each) and loading paths (one task each)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from solver.scenes import Scene
from studies.definition.parameters import build

USUAL_AXES = ("load_ratio", "friction", "hardening")
"""Parameters that every data set carries as dimensions, of size one where they are not swept."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run: its parameters, its id, and its position in the sweep.

    Attributes
    ----------
    id : content id of the run, the same in every study
    scene : the scene of the run
    values : all parameters by name, as JSON values
    index : position on each axis of the study
    """

    id: str
    scene: Scene = field(repr=False)
    values: Mapping[str, Any]
    index: tuple[int, ...]

    @property
    def parameters(self) -> Any:
        """The scene's parameter object, built when requested."""
        return build(self.scene, self.values)


@dataclass(frozen=True, slots=True)
class LoadingPath:
    """Cases that differ only in the scene's branch parameter; one task computes them together.

    Attributes
    ----------
    id : content id of the parameters that the cases share
    parameters : the scene's parameter object of the first case
    cases : in increasing order of the branch parameter
    """

    id: str
    parameters: Any
    cases: tuple[Case, ...]
