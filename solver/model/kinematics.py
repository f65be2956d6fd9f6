"""Kinematics of a two-dimensional body: the assumption on the third direction."""

from __future__ import annotations

from typing import Literal, get_args

Kinematics = Literal["plane_strain", "plane_stress", "axisymmetric"]
KINEMATICS: tuple[str, ...] = get_args(Kinematics)
