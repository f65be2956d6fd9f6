"""A scene that takes as long, and fails as often, as a test wants; it logs what it computes."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import check
from solver.results.record import Record, Status
from solver.scenes.scene import Scene

LOG = "FAKE_SCENE_LOG"
"""Environment variable: file that gets a line for each record computed, its parameters."""

INCREMENTS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class FakeParameters:
    """Parameters of the fake scene."""

    load_ratio: Annotated[float, Interval(gt=0.0, le=10.0), Unit("1")] = field(
        default=0.5, metadata={"description": "load"}
    )
    friction: Annotated[float, Interval(ge=0.0, le=1.0), Unit("1")] = field(
        default=0.0, metadata={"description": "friction"}
    )
    hardening: Literal["none", "isotropic"] = field(
        default="none", metadata={"description": "hardening"}
    )
    seconds: Annotated[float, Interval(ge=0.0, le=60.0), Unit("s")] = field(
        default=0.0, metadata={"description": "time one run takes"}
    )
    behaviour: Literal["good", "large", "limit", "raise", "die", "hang"] = field(
        default="good", metadata={"description": "how runs end"}
    )

    def __post_init__(self) -> None:
        check(self)
        if self.behaviour == "limit" and self.friction == 1.0:
            raise ModelError("friction", self.friction, "must be below 1 when behaviour is limit")


def path(parameters: FakeParameters, values: Sequence[float], monitor: object) -> Iterator[Record]:
    """Yield one record for each load ratio."""
    for position, load_ratio in enumerate(values):
        for increment in range(INCREMENTS):
            time.sleep(parameters.seconds / INCREMENTS)
            done = (position + (increment + 1) / INCREMENTS) / len(values)
            monitor(done)
        yield record(replace(parameters, load_ratio=load_ratio))


def record(parameters: FakeParameters) -> Record:
    """Return the outcome of one run, and write it down."""
    with Path(os.environ[LOG]).open("a") as log:
        log.write(json.dumps(asdict(parameters), sort_keys=True) + "\n")
    match parameters.behaviour:
        case "raise":
            raise ZeroDivisionError("a defect of the scene")
        case "die":
            os._exit(9)
        case "hang":
            time.sleep(600.0)
        case "limit":
            return Record(parameters=parameters, status=Status.LIMIT_LOAD, message="no equilibrium")
    x, y = np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 0.0, 4)
    stress = parameters.load_ratio * (1 + parameters.friction) * np.ones((4, y.size, x.size))
    stress[:, -1, 0] = np.nan
    return Record(
        parameters=parameters,
        status=Status.OUTSIDE_THEORY if parameters.behaviour == "large" else Status.OK,
        coordinates={"x": x, "y": y, "component": np.array(["xx", "yy", "zz", "xy"])},
        fields={
            "residual_stress": (("component", "y", "x"), stress),
            "plastic_strain": (("y", "x"), stress[0] / 1000),
        },
        scalars={"max_plastic_strain": parameters.load_ratio, "cpu_seconds": parameters.seconds},
    )


def seen(parameters: FakeParameters) -> Any:
    """Return what a picture asks of the view of a scene that has no model."""
    return SimpleNamespace(map_axes=("x", "y"), symmetric=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Canned(Scene):
    """A scene whose records come from a function, not from a model."""

    program: Any = None
    view: Any = seen
    outputs: tuple[Any, ...] = ()
    costs: tuple[Any, ...] = ()
    records: Any = None

    def path(self, parameters: Any, values: Sequence[float], monitor: object) -> Iterator[Record]:
        return self.records(parameters, values, monitor)


def register(scenes: ModuleType) -> None:
    """Add the fake scene to the named ones."""
    scenes.SCENES["fake"] = Canned(
        name="fake",
        summary="does as it is told",
        parameters=FakeParameters,
        branch="load_ratio",
        records=path,
    )
