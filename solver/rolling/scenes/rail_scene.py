"""What scenes of passes over a prism have in common: parameters, outputs, advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

from annotated_types import Interval, Unit

from solver.late import Late, late
from solver.model.friction import coefficient
from solver.parameters import Fraction, Other, described
from solver.rolling.load import FULL_SLIP, RollingLoad
from solver.rolling.scenes.wheel_parameters import WheelParameters
from solver.scenes.scene import Scene

ROUGH = {"friction": Other(0.0), "cohesion": Other(0.0), "friction_law": Other("coulomb")}
"""Parameters of which a creepage needs one to have an effect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrismParameters(WheelParameters):
    """Passes and motion of a wheel on a prism that yields (N, mm, MPa)."""

    passes: Annotated[int, Interval(ge=1, le=1000)] = described(1, "number of passes")
    friction: Fraction = coefficient(0.17)
    given_creepage: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.0,
        "prescribed creepage 1 - w R / V of a wheel that turns by w and advances by V",
        needs=ROUGH,
    )
    lateral_creepage: Annotated[float, Interval(ge=-0.1, le=0.1), Unit("1")] = described(
        0.0,
        "velocity of the axle along z over that along x, as by skew; the yaw of a wheel adds to it",
        needs=ROUGH,
    )

    def each_pass(self) -> Sequence[Self]:
        """Return the parameters of each pass; those of equal passes are one object."""
        return [self] * self.passes

    def under(self, force: float) -> RollingLoad:
        """Return the load with this vertical force [N], and the motion of the wheel."""
        locked = self.traction == 1.0
        drive = self.traction * self.friction * force
        return RollingLoad(
            force=force,
            drive=None if locked or self.control == "creepage" else drive,
            creepage=FULL_SLIP if locked else self.given_creepage,
            lateral_creepage=self.lateral_creepage,
        )

    @property
    def rubbing(self) -> Mapping[str, Any]:
        """Friction and strength, as `RollingPatch` takes them."""
        return {
            "friction": self.friction_part,
            "strength": self.material().shear_yield_stress,
        }


def rail_scene(
    name: str, summary: str, parameters: type[Any], *, geometry: Late, outputs: tuple[Late, ...],
) -> Scene:  # fmt: skip
    """Return a scene whose set-up is in ``NAME_setup``.

    Parameters
    ----------
    geometry : (parameters) -> what the set-up depends on
    outputs : further ones, after maps, profiles, extremes, the contact patch and the section
    """
    method, view, sketch, effort, advice = late(
        f"rolling.scenes.{name}_setup", "method", "view", "sketch", "effort", "advice"
    )
    return Scene(
        name=name,
        summary=summary,
        parameters=parameters,
        branch="passes",
        method=method,
        view=view,
        sketch=sketch,
        outputs=(
            *late("results.maps", "maps", "profiles"),
            *late("results.figures", "residual_extremes", "extremes"),
            *late("rolling.scenes.rail_outputs", "patch", "section"),
            *outputs,
        ),
        costs=(
            *late("results.figures", "cost"),
            *late("rolling.scenes.rail_outputs", "accuracy"),
        ),
        warnings=late("rolling.scenes.rail_outputs", "undecided")[0],
        effort=effort,
        setup=geometry,
        advice=advice,
        derives=0.9,
    )
