"""Values at places of the user's own: along lines, at points, on contact surfaces, over time.

Lines and surfaces are sampled at equal fractions of their length, so that runs whose lengths differ
still have one index; the positions are stored beside.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.results.quantities import Quantity, declare
from solver.tensors import not_below_zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.results.history import Observed
    from solver.results.look import Values
    from solver.results.slave import Slave

    Array = NDArray[np.float64]

FRACTION = declare(
    "fraction", "fraction of the length of a line or contact surface", dims=("fraction",)
)
LINE = declare("line", "line", "", dims=("line",))
POINT = declare("point", "point", "", dims=("point",))
CONTACT = declare("contact", "contact pair", "", dims=("contact",))
PART = declare("part", "body or rigid body", "", dims=("part",))
MOMENT = declare("moment", "number of the increment of the program", dims=("moment",))

_LINE = ("line", "fraction")
_STATES = ("line", "stage", "fraction")
LINE_X = declare("line_x", "position along x of a point of the line", "mm", dims=_LINE)
LINE_Y = declare("line_y", "position along y of a point of the line", "mm", dims=_LINE)
LINE_DISTANCE = declare("line_distance", "distance from the start of the line", "mm", dims=_LINE)
LINE_STRESS = declare(
    "line_stress", "stress along the line", "MPa", dims=("line", "stage", "component", "fraction")
)
LINE_MISES = declare("line_mises", "von Mises stress along the line", "MPa", dims=_STATES)
LINE_STRAIN = declare(
    "line_plastic_strain", "equivalent plastic strain along the line", dims=_STATES
)

_POINT = ("point", "stage")
POINT_X = declare("point_x", "position of the point along x", "mm", dims=("point",))
POINT_Y = declare("point_y", "position of the point along y", "mm", dims=("point",))
POINT_STRESS = declare(
    "point_stress", "stress at the point", "MPa", dims=("point", "stage", "component")
)
POINT_MISES = declare("point_mises", "von Mises stress at the point", "MPa", dims=_POINT)
POINT_STRAIN = declare(
    "point_plastic_strain", "equivalent plastic strain at the point", dims=_POINT
)
POINT_MOVED = tuple(
    declare(f"point_displacement_{a}", f"displacement of the point along {a}", "mm", dims=_POINT)
    for a in "xy"
)

_PAIR, _PAIRS = ("contact", "fraction"), ("contact", "stage", "fraction")
PAIR_X = declare("pair_x", "position along x of a point of the slave", "mm", dims=_PAIR)
PAIR_Y = declare("pair_y", "position along y of a point of the slave", "mm", dims=_PAIR)
PAIR_DISTANCE = declare(
    "pair_distance", "distance along the slave from its start", "mm", dims=_PAIR
)
PAIR_PRESSURE = declare(
    "pair_pressure", "contact pressure over the area before loading", "MPa", dims=_PAIRS
)
PAIR_SHARED = declare(
    "pair_pressure_deformed", "contact pressure over the deformed area", "MPa", dims=_PAIRS
)
PAIR_SHEAR = declare(
    "pair_shear", "contact shear on the slave along its surface", "MPa", dims=_PAIRS
)
PAIR_GAP = declare("pair_gap", "gap of the surfaces", "mm", dims=_PAIRS)
PAIR_SLIP = declare(
    "pair_slip", "slip of the slave on the master along its surface", "mm", dims=_PAIRS
)

_PART, _FORCE = ("part", "moment"), ("contact", "moment")
MOMENT_TIME = declare(
    "moment_time", "time of the program: stages done, or load factor", dims=("moment",)
)
REACTION = tuple(
    declare(f"reaction_{a}", f"force of supports and prescribed motions along {a}", "N", dims=_PART)
    for a in "xy"
)
MOTION = tuple(
    declare(f"motion_{a}", f"displacement of a rigid body along {a}", "mm", dims=_PART)
    for a in "xy"
)
ROTATION = declare("motion_rotation", "rotation of a rigid body", "rad", dims=_PART)
NORMAL_FORCE = declare("contact_normal_force", "sum of the normal forces", "N", dims=_FORCE)
TANGENTIAL_FORCE = declare(
    "contact_tangential_force", "sum of the tangential forces on the slave", "N", dims=_FORCE
)


class Places(NamedTuple):
    """Named places in a body: (2, n) [mm]."""

    body: str
    X: Array


class SystemFields:
    """Fields of a system at its states, each computed once.

    Parameters
    ----------
    stages : states by name
    """

    def __init__(self, system: System, stages: Mapping[str, Converged]) -> None:
        self.system, self.stages = system, stages
        self.at_nodes = cache(self._at_nodes)
        self.at_points = cache(self._at_points)
        self.on_pair = cache(self._on_pair)

    def _at_nodes(self, body: str, stage: str) -> dict[str, Array]:
        """Return fields at the nodes of a body, see `nodal_fields`."""
        from solver.results.nodal import nodal_fields  # only who computes needs scipy

        return nodal_fields(self.system, body, self.stages[stage])

    def _at_points(self, body: str, stage: str) -> tuple[Array, Array, Array]:
        """Return positions (2, n), von Mises stress and plastic strain at integration points."""
        from solver.tensors import von_mises

        found = self.system.response(body, self.stages[stage])
        return self.system.positions(body), von_mises(found.stress), found.state.accumulated

    def at(self, places: Places, stage: str) -> dict[str, Array]:
        """Return the same at places of a body; NaN outside of it."""
        from solver.fem.fields import Sampler

        sampler = Sampler(self.system.full(places.body), places.X)
        found = {name: sampler(f) for name, f in self.at_nodes(places.body, stage).items()}
        positive = ("von_mises", "plastic_strain")
        return found | {name: not_below_zero(found[name]) for name in positive}

    def _on_pair(self, pair: int, stage: str) -> Slave:
        """Return what acts on the slave of a pair."""
        from solver.results.slave import on_slave

        return on_slave(self.system, self.stages[stage], pair)


def along_lines(fields: SystemFields, lines: Mapping[str, Places]) -> Values:
    """Return stress and plastic strain along lines, all of as many points."""
    X = np.stack([line.X for line in lines.values()])
    distance = np.linalg.norm(np.diff(X, axis=2), axis=1)
    found = _states(fields, lines)
    return {
        LINE: np.array(list(lines)),
        FRACTION: np.linspace(0.0, 1.0, X.shape[2]),
        LINE_X: X[:, 0],
        LINE_Y: X[:, 1],
        LINE_DISTANCE: np.pad(np.cumsum(distance, axis=1), ((0, 0), (1, 0))),
        LINE_STRESS: found["stress"],
        LINE_MISES: found["von_mises"],
        LINE_STRAIN: found["plastic_strain"],
    }


def at_points(fields: SystemFields, points: Mapping[str, Places]) -> Values:
    """Return stress, plastic strain and displacement at points."""
    found = {name: each[..., 0] for name, each in _states(fields, points).items()}
    moved = dict(zip(POINT_MOVED, np.moveaxis(found["displacement"], -1, 0), strict=True))
    X = np.stack([point.X[:, 0] for point in points.values()])
    return {
        POINT: np.array(list(points)),
        POINT_X: X[:, 0],
        POINT_Y: X[:, 1],
        POINT_STRESS: found["stress"],
        POINT_MISES: found["von_mises"],
        POINT_STRAIN: found["plastic_strain"],
        **moved,
    }


def _states(fields: SystemFields, places: Mapping[str, Places]) -> dict[str, Array]:
    """Return each field over places, stages, its own components and points."""
    every = [[fields.at(place, stage) for stage in fields.stages] for place in places.values()]
    return {
        name: np.stack([np.stack([each[name] for each in place]) for place in every])
        for name in every[0][0]
    }


def on_pairs(fields: SystemFields, names: Sequence[str], samples: int) -> Values:
    """Return what acts on the slaves of contact pairs, the gap and the slip."""
    fraction = np.linspace(0.0, 1.0, samples)
    every = [[fields.on_pair(k, stage) for stage in fields.stages] for k in range(len(names))]
    at = [fraction * pair[0].s[-1] for pair in every]

    def spread(name: str) -> Array:
        return np.stack([
            np.stack([np.interp(s, each.s, getattr(each, name)) for each in pair])
            for s, pair in zip(at, every, strict=True)
        ])  # fmt: skip

    X = [[np.interp(s, pair[0].s, x) for x in pair[0].X] for s, pair in zip(at, every, strict=True)]
    return {
        CONTACT: np.array(list(names)),
        FRACTION: fraction,
        PAIR_X: np.stack([x for x, _ in X]),
        PAIR_Y: np.stack([y for _, y in X]),
        PAIR_DISTANCE: np.stack(at),
        PAIR_PRESSURE: spread("pressure"),
        PAIR_SHARED: spread("pressure_deformed"),
        PAIR_SHEAR: spread("shear"),
        PAIR_GAP: spread("gap"),
        PAIR_SLIP: spread("slip"),
    }


def over_time(
    history: Sequence[Observed], times: Sequence[float], parts: Sequence[str], pairs: Sequence[str]
) -> Values:
    """Return reactions, motions and contact forces at the ends of the program's increments.

    Parameters
    ----------
    history : every increment, those that were cut in parts too
    times : at which the increments of the program end, the beginning first
    parts, pairs : names of all bodies, those without a mesh too, and of the contact pairs
    """
    kept = _in_order(history, times)
    lost = (np.nan, np.nan, np.nan)
    reactions = np.array([[o.reactions.get(p, lost) if o else lost for o in kept] for p in parts])
    motions = np.array([[o.motions.get(p, lost) if o else lost for o in kept] for p in parts])
    out: dict[Quantity, Any] = {
        PART: np.array(list(parts)),
        MOMENT: np.arange(len(times)),
        MOMENT_TIME: np.array(times),
        REACTION[0]: reactions[..., 0],
        REACTION[1]: reactions[..., 1],
        MOTION[0]: motions[..., 0],
        MOTION[1]: motions[..., 1],
        ROTATION: motions[..., 2],
    }
    if pairs:
        none = [lost[:2]] * len(pairs)
        forces = np.array([o.contact if o else none for o in kept])
        out |= {
            CONTACT: np.array(list(pairs)),
            NORMAL_FORCE: forces[..., 0].T,
            TANGENTIAL_FORCE: forces[..., 1].T,
        }
    return out


def _in_order(history: Sequence[Observed], times: Sequence[float]) -> list[Observed | None]:
    """Return the increment that ends at each of the times, None where it was not computed."""
    found: list[Observed | None] = []
    at = 0
    for time in times:
        later = range(at, len(history))
        near = (k for k in later if math.isclose(history[k].time, time, abs_tol=1e-12))
        k = next(near, None)
        found.append(None if k is None else history[k])
        at = at if k is None else k + 1
    return found
