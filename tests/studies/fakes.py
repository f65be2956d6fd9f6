"""A scene that costs nothing, to test what is done with scenes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Gt, Interval, Unit

from solver.errors import ModelError
from solver.results.record import Record, Status
from solver.scenes import Monitor, Scene
from solver.shipped import SCENES

INCREMENTS = 10
COMPONENTS = ["xx", "yy", "zz", "xy"]


def described(default: Any, description: str) -> Any:
    return field(default=default, metadata={"description": description})


@dataclass(frozen=True, slots=True, kw_only=True)
class FakeParameters:
    load_ratio: Annotated[float, Interval(gt=0.0, le=10.0), Unit("1")] = described(0.5, "load")
    friction: Annotated[float, Interval(ge=0.0, le=1.0), Unit("1")] = described(0.0, "friction")
    hardening: Literal["none", "isotropic"] = described("none", "hardening rule")
    half_width: Annotated[float, Gt(0.0), Unit("mm")] = described(50.0, "half-width")
    points: Annotated[int, Interval(ge=2, le=400)] = described(5, "points of the map")
    passes: Annotated[int, Interval(ge=1, le=10)] = described(1, "passes over the body")
    seconds: Annotated[float, Interval(ge=0.0), Unit("s")] = described(0.0, "duration of a path")
    state: Literal["plane_strain", "plane_stress"] = described("plane_stress", "out of plane")
    trouble: Literal[
        "none", "warn", "large", "limit", "raise", "short", "die", "die_once", "bare", "unwritable"
    ] = described("none", "what goes wrong at load_ratio 0.8 and above")
    mark: str = described("", "directory that counts how often a path was begun")

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.state == "plane_strain" and self.friction > 0.9:
            raise ModelError("friction", self.friction, "at most 0.9 in plane strain")


def check_ranges(parameters: FakeParameters) -> None:
    """Refuse what the fields do not allow, as the parameters of every scene do."""
    allowed = {
        "load_ratio": 0.0 < parameters.load_ratio <= 10.0,
        "friction": 0.0 <= parameters.friction <= 1.0,
        "hardening": parameters.hardening in ("none", "isotropic"),
        "half_width": parameters.half_width > 0.0,
        "points": 2 <= parameters.points <= 400,
        "passes": 1 <= parameters.passes <= 10,
        "seconds": parameters.seconds >= 0.0,
        "state": parameters.state in ("plane_strain", "plane_stress"),
    }
    for name, holds in allowed.items():
        if not holds:
            raise ModelError(name, getattr(parameters, name), "out of range")


def path(parameters: FakeParameters, values: Sequence[float], monitor: Monitor) -> Iterator[Record]:
    """Yield a record for each load ratio, after some increments."""
    if parameters.mark:
        name = f"{parameters.friction}-{time.time_ns()}-{os.getpid()}"
        (Path(parameters.mark) / name).write_text(" ".join(map(str, values)))
    for number, load_ratio in enumerate(values):
        run = replace(parameters, load_ratio=load_ratio)
        for step in range(INCREMENTS):
            time.sleep(parameters.seconds / INCREMENTS / len(values))
            done = (number + (step + 1) / INCREMENTS) / len(values)
            monitor(done)
        if load_ratio >= 0.8 and parameters.trouble != "none":
            if parameters.trouble == "short":
                return
            yield troubled(run)
        else:
            yield record(run)


def troubled(run: FakeParameters) -> Record:
    """Return, or do, what goes wrong."""
    if run.trouble == "raise":
        raise ZeroDivisionError("the stiffness is gone")
    if run.trouble == "die" or (run.trouble == "die_once" and first_time(run)):
        os.kill(os.getpid(), signal.SIGKILL)
    if run.trouble == "limit":
        known = {"x": record(run).coordinates["x"]}
        return Record(
            parameters=run, status=Status.LIMIT_LOAD, message="flows at 0.75", coordinates=known,
            symmetric=True,
        )  # fmt: skip
    if run.trouble == "warn":
        return replace(record(run), message="strains are large")
    if run.trouble == "large":
        return replace(record(run), status=Status.OUTSIDE_THEORY, message="strain reaches 14%")
    if run.trouble == "unwritable" and run.load_ratio < 1.0:
        return replace(record(run), fields={"residual_stress": (("nowhere",), np.zeros(1))})
    if run.trouble == "bare":
        return Record(parameters=run, status=Status.NOT_CONVERGED, message="increment 3")
    return record(run)


def first_time(run: FakeParameters) -> bool:
    """Tell whether no process died here before."""
    try:
        (Path(run.mark) / "died").touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def record(run: FakeParameters) -> Record:
    """Return the record of one run: smooth fields of the right shape."""
    a = run.half_width
    x = np.linspace(0.0, 2.0 * a, run.points)
    y = np.linspace(-a, a, run.points + 1)
    s = np.linspace(0.0, a, run.points)
    components = COMPONENTS if run.state == "plane_strain" else ["xx", "yy", "xy"]
    size = 100.0 * run.load_ratio * (1.0 + run.friction)
    stress = np.array(
        [
            size * (k + 1) * np.sin(np.pi * x[None, :] / a) * np.exp(-np.abs(y[:, None]) / a)
            for k, _ in enumerate(components)
        ]
    )
    stress[:, y > 0.0, -1] = np.nan
    return Record(
        parameters=run,
        status=Status.OK,
        coordinates={
            "x": x,
            "y": y,
            "s": s,
            "component": np.array(components),
            "pass": np.arange(1, run.passes + 1),
            "stage": np.array(["loaded", "unloaded"]),
            "body": np.array(["punch", "half_plane"]),
        },
        fields={
            "residual_stress": (("component", "y", "x"), stress),
            "plastic_strain": (("y", "x"), np.abs(stress[0]) * 1e-5),
            "pass_creepage": (("pass",), size * np.arange(1.0, run.passes + 1.0)),
            "contact_pressure": (("stage", "s"), np.array([size + s, 0.0 * s])),
        },
        scalars={
            "contact_half_width": a,
            "peak_contact_pressure": size + a,
            "peak_residual_tension": float(np.nanmax(stress)),
            "increments": float(INCREMENTS),
            "cpu_seconds": run.seconds,
            "audit_balance": 1e-12,
        },
        symmetric=True,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Canned(Scene):
    """A scene whose records come from a function, not from a model."""

    program: Any = None
    view: Any = None
    outputs: tuple[Any, ...] = ()
    costs: tuple[Any, ...] = ()
    records: Any = None

    def path(
        self, parameters: Any, values: Sequence[float], monitor: Monitor, begun: Any = None
    ) -> Iterator[Record]:
        return self.records(parameters, values, monitor)


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed(Canned):
    """The same, whose loading paths go on for values that are asked for one by one."""

    @property
    def goes_on(self) -> bool:
        return True

    def follow(
        self, parameters: Any, values: Iterable[float], largest: float, monitor: Monitor
    ) -> Iterator[Record]:
        for value in values:
            assert value <= largest
            yield from self.records(parameters, [value], monitor)


def bare(record: Record) -> Record:
    """Return a record without fields: a run is written and read twice as fast."""
    return replace(record, coordinates={}, fields={})


def numbers(
    parameters: FakeParameters, values: Sequence[float], monitor: Monitor
) -> Iterator[Record]:
    """Yield the same records without fields."""
    yield from map(bare, path(parameters, values, monitor))


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchedParameters(FakeParameters):
    """The same with values that are neither numbers nor words."""

    hot: bool = described(False, "whether it is hot")
    width: Annotated[float, Gt(0.0), Unit("mm")] | None = described(None, "width, if it is given")


FAKE = Canned(
    name="fake",
    summary="a scene that costs nothing",
    parameters=FakeParameters,
    branch="load_ratio",
    records=path,
)
SCENES[FAKE.name] = FAKE
NUMBERS = replace(FAKE, name="numbers", records=numbers)
SCENES[NUMBERS.name] = NUMBERS
SWITCHED = Canned(
    name="switched",
    summary="a scene with a switch",
    parameters=SwitchedParameters,
    branch="load_ratio",
    records=path,
)
FOLLOWED = Followed(
    name="followed",
    summary="a scene that costs nothing, whose paths go on",
    parameters=FakeParameters,
    branch="load_ratio",
    records=numbers,
)
SCENES[FOLLOWED.name] = FOLLOWED
