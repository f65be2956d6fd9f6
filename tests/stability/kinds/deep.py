"""Seeded scenes of large strain: indented, deep-rolled, expanded and joined parts.

No closed form is known. An answer must be that of independent formulas (`tests.recomputed`); where
there is none, the record must say why and what helps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from solver import Record, Scene
from solver.results.record import Status
from solver.results.run import FinishedRun
from studies.scenes.registry import scene_named
from studies.scenes.scene import read_scene
from tests.architecture.sources import ROOT
from tests.recomputed.record import differences
from tests.stability.kinds.looked_at import looked_at
from tests.stability.trial import Figure
from tests.stability.trial import Scene as Trial

SHORT = (2,)
"""Scene of the test suite: a cone. Each takes some seconds."""
SEED = 1908
_REMEDY = ("reduce", "lower", "refine", "smaller", "larger", "harden", "more", "prescribe", "raise")
"""Words of a message that says what helps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deep:
    """A scene of the package, or a scene file of ``data/scenes``, with its parameters."""

    name: str
    parameters: dict[str, Any]

    def solve(self) -> tuple[Scene, FinishedRun, Record]:
        """Solve it."""
        path = ROOT / "data" / "scenes" / f"{self.name}.toml"
        scene = read_scene(path) if path.exists() else scene_named(self.name)
        return scene, *looked_at(scene, scene.parameters(**self.parameters))


def judge(found: tuple[Scene, FinishedRun, Record]) -> dict[str, Figure]:
    """Return what is wrong with an answer, or with the reason why there is none."""
    scene, run, record = found
    if record.status is not Status.OK:
        helps = any(word in record.message for word in _REMEDY)
        return {f"{record.status.name}: {record.message[:200]}": Figure(1.0 - helps, 0.0)}
    p = run.parameters
    places = scene.places(p) if scene.places else None
    wrong = list(differences(run, record, scene.view(p), places))
    return {"recomputed" + "".join(f"; {each}" for each in wrong): Figure(len(wrong), 0)}


def _ball(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "accuracy": "draft", "radius": 1.0, "unload_steps": 4,
        "yield_stress": float(rng.choice([100.0, 400.0, 1500.0])),
        "yielding": str(rng.choice(["half_space", "half_space", "ball"])),
        "load_ratio": float(np.exp(rng.uniform(np.log(3), np.log(20)))),
        "strain": str(rng.choice(["large", "region"])),
    }  # fmt: skip


def _punch(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "accuracy": "draft", "element": "quad4",
        "state": str(rng.choice(["plane_stress", "plane_strain", "axisymmetric"])),
        "load_ratio": float(rng.uniform(0.3, 1.3)),
        "strain": str(rng.choice(["large", "region", "region"])),
    }  # fmt: skip


def _cone(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "accuracy": "draft", "unload_steps": 10,
        "yield_stress": float(np.exp(rng.uniform(np.log(50), np.log(3000)))),
        "half_angle": float(rng.uniform(60, 85)),
    }  # fmt: skip


def _fillet(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "pressed": float(rng.uniform(0.01, 0.1)), "tool": float(rng.uniform(0.6, 1.4)),
        "friction": float(rng.uniform(0, 0.3)), "size": 0.1, "strain": "large",
    }  # fmt: skip


def _mandrel(rng: np.random.Generator) -> dict[str, Any]:
    return {"expansion": float(rng.uniform(0.01, 0.06)), "friction": float(rng.uniform(0, 0.3)),
            "size": 0.5}  # fmt: skip


def _clinch(rng: np.random.Generator) -> dict[str, Any]:
    return {"stroke": float(rng.uniform(0.2, 1.2)), "friction": float(rng.uniform(0, 0.4)),
            "size": 0.25}  # fmt: skip


_KINDS = {"ball": _ball, "punch": _punch, "cone": _cone, "fillet": _fillet, "mandrel": _mandrel,
          "clinch": _clinch}  # fmt: skip
_HARDENING = ("none", "isotropic", "kinematic", "mixed")


def scenes(count: int) -> list[Trial]:
    """Return scenes of all kinds in turn."""
    rng, made = np.random.default_rng(SEED), list[Trial]()
    for number in range(count):
        name = list(_KINDS)[number % len(_KINDS)]
        given = _KINDS[name](rng)
        if name in ("ball", "punch", "cone"):
            given["hardening"] = str(rng.choice(_HARDENING))
            given["friction"] = float(rng.choice([0.0, 0.1, 0.4]))
        what = ", ".join(f"{key} {value}" for key, value in given.items())
        solve = Deep(name=name, parameters=given).solve
        made.append(Trial(what=f"{name}: {what}", run=solve, judge=judge))
    return made
