"""Kinematics of a two-dimensional body: the assumption on the third direction."""

from __future__ import annotations

from typing import Literal

Kinematics = Literal["plane_strain", "plane_stress", "axisymmetric"]
