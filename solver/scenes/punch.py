"""Elastic-plastic punch pressed on an elastic-plastic half-plane."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from annotated_types import Gt, Interval, Unit

from solver.record import Record
from solver.scenes.scene import Monitor, Scene


def described(default: Any, description: str) -> Any:
    """Return a dataclass field with its default and its description."""
    return field(default=default, metadata={"description": description})


@dataclass(frozen=True, slots=True, kw_only=True)
class PunchParameters:
    """Parameters of the punch scene (N, mm, MPa)."""

    load_ratio: Annotated[float, Interval(gt=0.0, le=10.0), Unit("1")] = described(
        0.5714, "mean pressure on the punch / yield stress"
    )
    friction: Annotated[float, Interval(ge=0.0, le=1.0), Unit("1")] = described(
        0.0, "Coulomb friction coefficient"
    )
    hardening: Literal["none", "isotropic", "kinematic", "mixed"] = described(
        "none", "hardening rule of the yielding bodies"
    )
    hardening_ratio: Annotated[float, Interval(ge=0.0, lt=1.0), Unit("1")] = described(
        0.024, "slope Eu of the uniaxial hardening branch / Young's modulus"
    )
    yield_stress: Annotated[float, Gt(0.0), Unit("MPa")] = described(
        350.0, "uniaxial yield stress Re"
    )
    half_width: Annotated[float, Gt(0.0), Unit("mm")] = described(50.0, "punch half-width a")


def path(
    parameters: PunchParameters, values: Sequence[float], monitor: Monitor
) -> Iterator[Record]:
    """Yield one record for each load ratio."""
    raise SystemExit("the path of the punch is being written")


PUNCH = Scene(
    name="punch",
    summary="elastic-plastic punch pressed on an elastic-plastic half-plane, and released",
    parameters=PunchParameters,
    branch="load_ratio",
    path=path,
)
