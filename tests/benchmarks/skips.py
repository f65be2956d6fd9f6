"""What is left out where a scene does not need it: the same problem with and without.

Each pair of `SKIPS` gives the same numbers, which `tests/solver/test_skips.py` proves; here it is
timed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from solver import SCENES, Body, ContactPair, Material, Model, PathControl, solve
from solver.contact import candidates
from solver.memory import release
from solver.mesh import grid
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import steady_passes
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model
from tests.benchmarks.measure import timed

Array = NDArray[np.float64]
CONTROL = PathControl(load_step=0.1, unload_steps=2)
PUNCH = PunchParameters(
    friction=0.3, smallest_element=0.01, growth=1.5, half_plane_size=10.0, elastic_punch=True
)


@dataclass(frozen=True)
class Skip:
    """Something left out: ``short`` leaves it out, ``whole`` does not; both return numbers."""

    what: str
    short: Callable[[], Array]
    whole: Callable[[], Array]
    apart: float  # largest difference of the numbers over the largest of them


def _blocks(*, half: bool, friction: float = 0.3) -> Array:
    """Return how nodes x >= 0 of a block that yields, pressed on a wider one, move along y [mm]."""
    law = Material(
        youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0, hardening="isotropic",
        hardening_ratio=0.05,
    )  # fmt: skip
    bodies = []
    for name, width, low, high in (("upper", 4.0, 0.0, 3.0), ("lower", 8.0, -6.0, 0.0)):
        x = np.linspace(-width, width, int(6 * width) + 1)
        supports = {"left": "x"} if half else {}
        if name == "lower":
            supports["bottom"] = "xy"
        elif not half:
            supports["middle"] = "x"
        mesh = grid(x[x >= 0] if half else x, np.linspace(low, high, int(3 * (high - low)) + 1))
        if not half:
            middle = np.flatnonzero(np.abs(mesh.p[0, mesh.facets]).max(axis=0) < 1e-9)
            mesh = mesh.with_boundaries({"middle": middle})
        load = {"top": 330.0} if name == "upper" else {}
        bodies.append(Body(name=name, mesh=mesh, material=law, supports=supports, pressure=load))
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=friction)
    solution = solve(Model(bodies=tuple(bodies), contacts=(pair,)), control=CONTROL)
    out = []
    for body in ("upper", "lower"):
        x, y = solution.nodes(body)
        right = np.flatnonzero(x > -1e-9)
        right = right[np.lexsort((x[right], y[right]))]
        out.append(solution.displacement(body, "loaded")[1, right])
    return np.concatenate(out)


def _punch(*, condense: bool = True, yield_stress: float = np.inf, **changes: float) -> Array:
    """Return the contact pressure [MPa] under an elastic punch."""
    whole = model(replace(PUNCH, **changes))
    punch, below = whole.bodies
    material = replace(punch.material, yield_stress=yield_stress)
    bodies = (replace(punch, condense=condense, material=material), below)
    solution = solve(replace(whole, bodies=bodies), load=0.5, control=CONTROL)
    return np.asarray(solution.contact().pressure)


def _all_candidates() -> Array:
    with patch.object(candidates, "_MARGIN", 1e9):
        return _punch()


def _passed() -> Array:
    """Return the residual stress [MPa] of a steady pass."""
    parameters = RollingParameters(element_size=2.0, growth=1.3)
    (found,) = steady_passes(parameters)
    return found.after.stress(parameters.material().elasticity)


def _passed_anew() -> Array:
    release(0)
    return _passed()


def _rolled(track: float | str) -> Array:
    """Return the largest plastic strain of a pass without friction, whose surface does not flow."""
    parameters = RollingParameters(
        element_size=2.0, growth=1.3, load="hertz", friction=0.0, load_ratio=2.2, track=track,
        advance_step=1.0,
    )  # fmt: skip
    (record,) = SCENES["rolling"].path(parameters, [1], lambda share: None)
    return np.array([record.scalars["highest_plastic_strain"]])


SKIPS = (
    Skip("symmetry", lambda: _blocks(half=True), lambda: _blocks(half=False), 1e-6),
    Skip("no friction", lambda: _punch(friction=0.0), lambda: _punch(friction=1e-9), 1e-6),
    Skip(
        "never yields",
        lambda: _punch(condense=False),
        lambda: _punch(condense=False, yield_stress=1e9),
        1e-6,
    ),
    Skip("elastic body", _punch, lambda: _punch(condense=False), 1e-6),
    Skip("contact candidates", _punch, _all_candidates, 1e-6),
    Skip("kept factor", _passed, _passed_anew, 0.0),
)
STEADY = Skip("steady pass", lambda: _rolled("endless"), lambda: _rolled(64.0), 0.1)
"""Not the same numbers: steps have ends, and errors by increments, which
`tests/verification/test_track_ends.py` proves to vanish."""


def measure(repeats: int) -> list[tuple[str, float, float, float]]:
    """Return, for what is left out, CPU seconds with it and without, and the difference."""
    rows = []
    for skip in (*SKIPS, STEADY):
        skip.short()  # what is shared by all runs is made
        short = timed(lambda _, skip=skip: skip.short(), repeats)
        whole = timed(lambda _, skip=skip: skip.whole(), repeats)
        rows.append((skip.what, whole.cpu, short.cpu, apart(short.result, whole.result)))
    return rows


def apart(one: Array, other: Array) -> float:
    """Return the largest difference over the largest number."""
    return float(np.abs(one - other).max() / np.abs(other).max())
