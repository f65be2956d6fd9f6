"""Supports and loads of bodies as symbols, before anything is computed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, get_args, get_type_hints

import numpy as np
from annotated_types import Unit
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETLEFT, CARETRIGHT, CARETUP
from skfem import Mesh

from solver.model.amplitude import Amplitude
from solver.model.body import Body
from solver.model.loads import Load
from solver.model.rigid import Pushed, RigidBody
from studies.numbers import typeset_number
from studies.views.columns import words
from studies.views.plots.mapped import Array

_FORCE, _MOTION, _FIELD, _HELD = "#c2410c", "#15803d", "#b45309", "0.15"
_ARROW = 0.38
"""Length of the longest arrow of a load [in]."""
_APART = 0.14
"""Smallest distance of symbols [in]."""
_SYMBOLS = 7
"""Largest number of symbols along a boundary."""
_CARETS = {("x", True): CARETLEFT, ("x", False): CARETRIGHT, ("y", True): CARETDOWN,
           ("y", False): CARETUP}  # fmt: skip
"""Markers with their tip on the boundary, by component and whether the body is on its lower side:
seen along the component, the body is before the tip."""
_NAMES = {"boundary", "amplitude", "position", "region"}
"""Entries of loads that are not told as numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrows:
    """One load as it is drawn.

    Attributes
    ----------
    text : what it is
    at, way : (2, n) positions and directions of its arrows
    inward : (n,) whether an arrow ends on the boundary, as that of a pressure; else it begins there
    colour : of forces, of motions, or of fields
    """

    text: str
    at: Array
    way: Array
    inward: Array
    colour: str


def outward(mesh: Mesh, facets: Array) -> tuple[Array, Array]:
    """Return ends (2, n, 2) of facets, the body on their left, and outward normals (2, n).

    The normals are as long as the facets [mm].
    """
    ends = mesh.p[:, mesh.facets[:, facets]].transpose(0, 2, 1)
    inside = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    along, towards = ends[:, :, 1] - ends[:, :, 0], inside - ends[:, :, 0]
    right = along[0] * towards[1] - along[1] * towards[0] < 0.0
    ends = np.where(right[None, :, None], ends[:, :, ::-1], ends)
    along = ends[:, :, 1] - ends[:, :, 0]
    return ends, np.stack([along[1], -along[0]])


def acting(bodies: Sequence[Body], rigid: Sequence[RigidBody]) -> Iterator[Arrows]:
    """Yield the loads of bodies and the motions of rigid bodies, at load factor 1."""
    for body in bodies:
        for load in body.every_load:
            if not load.removes:
                yield _of_load(body, load)
        if body.axle is not None:
            force = body.axle.force
            text = (
                f"force on the axle of {body.name}: {typeset_number(np.abs(force.value).max())} N"
            )
            yield _single(text, body.axle.centre, (0.0, -1.0), _FORCE)
    for each in rigid:
        for axis, way in (("x", (1.0, 0.0)), ("y", (0.0, 1.0)), ("rotation", (0.0, 0.0))):
            motion = getattr(each, axis)
            if motion.value:
                pushed = isinstance(motion, Pushed)
                turns = axis == "rotation"
                kind, unit = ("turned", "rad") if turns else (f"moved {axis}", "mm")
                if pushed:
                    kind, unit = ("moment", "N mm") if turns else (f"force {axis}", "N")
                text = f"{each.name}: {kind} {typeset_number(motion.value)} {unit}"
                to = np.sign(motion.value) * np.array(way)
                yield _single(text, _place_of(each), to, _FORCE if pushed else _MOTION)


def _place_of(rigid: RigidBody) -> Array:
    """Return where the motion of a rigid body is drawn: on its surface, or at its centre there."""
    centre = np.asarray(rigid.centre, dtype=float)
    if not rigid.surfaces:
        return centre
    points = np.hstack([np.asarray(each.points) for each in rigid.surfaces.values()])
    size = float(np.ptp(points, axis=1).max())
    if np.linalg.norm(points - centre[:, None], axis=0).min() < 1e-6 * size:
        return centre
    away = np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=0)
    return np.asarray(points[:, int(away.argmin())])


def _single(text: str, at: Any, way: Any, colour: str) -> Arrows:
    place, to = np.reshape(at, (2, 1)), np.reshape(np.asarray(way, dtype=float), (2, 1))
    return Arrows(text=text, at=place, way=to, inward=np.array([True]), colour=colour)


def _of_load(body: Body, load: Load) -> Arrows:
    where = ", ".join(load.boundaries)
    text = f"{words(load.name)} {body.name}{f'.{where}' if where else ''}{_told(load)}"
    if not load.boundaries:
        middle = body.mesh.p[:, body.mesh.t].mean(axis=(1, 2)).reshape(2, 1)
        force = load.body_force(middle)
        way = np.zeros((2, 1)) if force is None else _unit(force)
        colour = _FIELD if force is None else _FORCE
        return Arrows(text=text, at=middle, way=way, inward=np.array([False]), colour=colour)
    facets = np.concatenate([body.facets(name) for name in load.boundaries])
    ends, normal = outward(body.mesh, facets)
    at, along = ends.mean(axis=2), ends[:, :, 1] - ends[:, :, 0]
    length, colour = np.linalg.norm(normal, axis=0), _FORCE
    chosen = _spread(length)
    force = load.push_at(_fullest(load), at, along) if load.moves else load.push(at, along)
    if force is not None:
        way = np.asarray(force) / length
        if load.moves:
            there = np.flatnonzero(way.any(axis=0))
            chosen = there[_spread(length[there])]
    else:
        moved = np.array([load.components.get(axis, 0.0) for axis in (0, 1)])
        way, colour = np.repeat(moved[:, None], len(length), axis=1), _MOTION
    way = _unit(way)
    inward = (way * normal).sum(axis=0) < -1e-9 * length
    return Arrows(
        text=text, at=at[:, chosen], way=way[:, chosen], inward=inward[chosen], colour=colour
    )


def _fullest(load: Load) -> float:
    """Return the time in the middle of those at which a load that moves is largest."""
    each = (getattr(load, own.name) for own in fields(load))
    times = np.unique([0.0, 1.0, *(t for a in each if isinstance(a, Amplitude) for t in a.time)])
    factor = np.array([load.factor(time) for time in times])
    full = times[factor >= 0.999 * factor.max()]
    return float(full[0] + full[-1]) / 2


def _told(load: Load) -> str:
    """Return the entries of a load that are not zero."""
    parts, hints = [], get_type_hints(type(load), include_extras=True)
    for each in fields(load):
        value = getattr(load, each.name)
        if each.name in _NAMES or value is None:
            continue
        own = "" if each.name == "value" else f"{words(each.name)} "
        if callable(value):
            parts.append(f"{own}varies")
        elif isinstance(value, int | float) and value:
            unit = _unit_in(hints[each.name])
            parts.append(f"{own}{typeset_number(value)}{'' if unit == '1' else f' {unit}'}")
    return f": {', '.join(parts)}" if parts else ""


def _unit_in(hint: Any) -> str:
    """Return the unit that the type of a number declares."""
    marks = [mark.unit for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, Unit)]
    return next((unit for unit in (*marks, *map(_unit_in, get_args(hint))) if unit != "1"), "1")


def _unit(way: Array) -> Array:
    """Return directions over the length of the longest."""
    longest = float(np.linalg.norm(way, axis=0).max()) if way.size else 0.0
    return way / longest if longest else way


def _spread(length: Array) -> Array:
    """Return the numbers of a few pieces of a line, spread evenly over its length."""
    if len(length) <= _SYMBOLS:
        return np.arange(len(length))
    reached = np.cumsum(length) - length / 2
    wanted = (np.arange(_SYMBOLS) + 0.5) / _SYMBOLS * length.sum()
    return np.unique(np.abs(reached[:, None] - wanted).argmin(axis=0))


def draw_acting(axes: Axes, load: Arrows, inch: float) -> dict[str, Any]:
    """Draw the arrows of a load where an inch is so many mm; return its entry of the legend."""
    moves = np.linalg.norm(load.way, axis=0) > 1e-9
    apart = _apart(load.at, inch)
    for inward in (True, False):
        own = apart & moves & (load.inward == inward)
        if own.any():
            axes.quiver(
                *load.at[:, own], *load.way[:, own], color=load.colour, angles="xy",
                scale_units="inches", scale=1.0 / _ARROW, pivot="tip" if inward else "tail",
                units="inches", width=0.018, headwidth=4.5, headlength=5.5, zorder=4,
            )  # fmt: skip
    colour = load.colour
    if not moves.any():
        axes.plot(*load.at, color=colour, marker="o", markersize=3.5, linestyle="none", zorder=4)
    marker: Any = r"$\rightarrow$" if moves.any() else "o"
    size = 10.0 if moves.any() else 4.0
    sign = Line2D([], [], color=colour, marker=marker, markersize=size, linestyle="none")
    return {load.text: sign}


def _apart(at: Array, inch: float) -> Array:
    """Return which of the positions (2, n) are drawn: none close to the one before."""
    kept: list[int] = []
    for k in range(at.shape[1]):
        if not kept or np.linalg.norm(at[:, k] - at[:, kept[-1]]) >= _APART * inch:
            kept.append(k)
    return np.isin(np.arange(at.shape[1]), kept)


def draw_supports(
    axes: Axes, body: Body, inch: float, springs: Sequence[str] = ()
) -> Mapping[str, Any]:
    """Draw the supports of a body, and boundaries on springs; return entries of the legend."""
    handles: dict[str, Any] = {}
    for boundary, held in (*body.supports.items(), *((name, "springs") for name in springs)):
        ends, normal = outward(body.mesh, body.facets(boundary))
        length = np.linalg.norm(normal, axis=0)
        at, chosen = ends.mean(axis=2), _spread(length)
        chosen = chosen[_apart(at[:, chosen], inch)]
        for axis in held if held != "springs" else "y":
            side = normal["xy".index(axis)] / length
            for k in chosen:
                marker: Any = "$\\wr$" if held == "springs" else _CARETS[axis, side[k] > 0.5]
                axes.plot(
                    *at[:, k], marker=marker, color=_HELD, markersize=6.0, linestyle="none",
                    zorder=3,
                )  # fmt: skip
        text = "on springs" if held == "springs" else f"held: {', '.join(held)}"
        sign: Any = "$\\wr$" if held == "springs" else CARETUP if "y" in held else CARETRIGHT
        handles[text] = Line2D([], [], color=_HELD, marker=sign, linestyle="none")
    return handles
