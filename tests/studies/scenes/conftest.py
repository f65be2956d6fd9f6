"""A small scene file, and how it is changed."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from typing import Any

import pytest

from studies.scenes.description import Description
from studies.scenes.file_scene import FileScene
from studies.scenes.scene import file_scene

BLOCKS = """
name = "blocks"
summary = "a block pressed on another one"

[parameters]
mu = { default = 0.2, range = [0.0, 1.0], description = "friction" }
wide = { default = 4.0, range = [1.0, 100.0], unit = "mm", description = "width of both blocks" }
rule = { default = "none", choices = ["none", "isotropic"], description = "hardening" }

[derived]
side = "$wide/4"

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = 300.0
hardening = "$rule"

[bodies.upper]
material = "steel"
shape = { kind = "rectangle", x = [0, "$wide"], y = [0, 2], size = "$side" }
supports = { left = "x" }

[bodies.lower]
material = "steel"
shape = { kind = "rectangle", x = [0, "$wide"], y = [-2, 0], size = "$side" }
supports = { bottom = "xy" }

[[contacts]]
name = "face"
slave = "upper.bottom"
master = "lower.top"
friction = "$mu"

[[loads]]
body = "upper"
kind = "pressure"
boundary = "top"
value = 150.0

[[stages]]
name = "pressed"
increments = 2

[results]
samples = 11
[results.lines.middle]
body = "lower"
start = ["$wide/2", 0.0]
end = ["$wide/2", -2.0]

[outputs.least]
of = "stress.yy"
take = "minimum"
body = "lower"
stage = "pressed"
"""

Change = Callable[[dict[str, Any]], object]


def blocks() -> dict[str, Any]:
    """Return the tables of the small scene."""
    return copy.deepcopy(tomllib.loads(BLOCKS))


def built(content: dict[str, Any]) -> FileScene:
    """Return the scene of tables, its bodies built once."""
    return file_scene(Description("blocks.toml", content, {}), built=True)


@pytest.fixture
def scene() -> FileScene:
    """Return the small scene."""
    return built(blocks())
