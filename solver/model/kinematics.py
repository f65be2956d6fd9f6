"""The two-dimensional states a body may be in."""

from __future__ import annotations

from typing import Literal, get_args

State = Literal["plane_strain", "plane_stress", "axisymmetric"]
STATES: tuple[str, ...] = get_args(State)
