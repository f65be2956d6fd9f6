"""The runs of a study: cases (one run each) and loading paths (one task each)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from solver.scenes import Scene
from studies.definition.identity import Namer, written
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

    @property
    def shorter(self) -> dict[str, int]:
        """Ids of the runs with a smaller whole value of the branch parameter, and their values."""
        branch = self.scene.branch
        value = self.values.get(branch)
        if not isinstance(value, int):
            return {}
        namer = Namer("run", self.scene.name, self.values, written(self.scene))
        at = namer.places([branch])
        return {namer.id_of([(at, [Namer.entry(branch, n)])]): n for n in range(1, value)}


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
