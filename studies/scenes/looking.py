"""Where a scene file looks: lines, points, contact surfaces, and numbers of every run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from solver.results.asked import Asked, Looked
from solver.results.places import (
    Places,
    SystemFields,
    along_lines,
    at_points,
    on_pairs,
    over_time,
)
from solver.results.view import View
from studies.scenes import tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.loading.program import Program
    from solver.results.look import Look, Values

    Array = NDArray[np.float64]

_NOWHERE = np.zeros(0)


def view_of(scene: tables.SceneFile) -> View:
    """Return the map grid and the states; lines and points are looked at by `looked`."""
    names = scene.stage_names
    released = "unloaded" if scene.loading else _released(scene)
    under_load = [name for name in names if name != released]
    grid = scene.look.map
    return View(
        x=grid.x.positions() if grid else _NOWHERE,
        y=grid.y.positions() if grid else _NOWHERE,
        depth=_NOWHERE,
        station=_NOWHERE,
        s=_NOWHERE,
        profile_body=next(iter(scene.bodies)),
        surfaces=dict.fromkeys(scene.bodies, ""),
        stages=tuple(names),
        loaded=under_load[-1] if under_load else names[-1],
        unloaded=released,
        symmetric=scene.symmetric,
    )


def _released(scene: tables.SceneFile) -> str:
    """Return the name of the last stage, if the bodies are released in it."""
    last = scene.stages[-1]
    return last.name if last.release and len(scene.stages) > 1 else ""


def asked(scene: tables.SceneFile) -> list[Asked]:
    """Return the numbers that the scene asks for of every run."""
    return [Asked(name=name, **each.model_dump()) for name, each in scene.outputs.items()]


def places_of(scene: tables.SceneFile) -> Looked:
    """Return the places that a scene file names, and the numbers that it asks for."""
    look = scene.look
    return Looked(
        lines={n: Places(line.body, places(line, look.samples)) for n, line in look.lines.items()},
        points={n: Places(at.body, np.array(at.at)[:, None]) for n, at in look.points.items()},
        contacts=[contact.name for contact in scene.contacts],
        asked=asked(scene),
    )


def looked(scene: tables.SceneFile, program: Program, look: Look) -> Values:
    """Return all that a scene file asks for of a run."""
    system: Any = look.system
    fields = SystemFields(system, {name: look.outcome.points[name] for name in look.view.stages})
    lines, points, contacts, numbers = places_of(scene)
    out: dict[Any, Any] = {}
    if lines:
        out |= along_lines(fields, lines)
    if points:
        out |= at_points(fields, points)
    if contacts:
        out |= on_pairs(fields, contacts, scene.look.samples)
    times = [0.0, *(target.time for target in program.targets)]
    out |= over_time(look.outcome.history, times, system.all_names, contacts)
    for number in numbers:
        out |= number.values(fields, lines, contacts)
    return out


def places(line: tables.LookLineTable, samples: int) -> Array:
    """Return the points of a line (2, n) [mm]."""
    if line.start is not None and line.end is not None:
        return np.linspace(line.start, line.end, samples).T
    assert line.centre is not None and line.angles is not None
    angle = np.radians(np.linspace(*line.angles, samples))
    circle = np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(np.array(line.centre)[:, None] + line.radius * circle)
