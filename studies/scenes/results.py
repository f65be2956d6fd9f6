"""Places and numbers of the results of a scene file: map, lines, points, contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.errors import ModelError
from solver.results.fatigue import Fatigue
from solver.results.named_places import NamedPlaces
from solver.results.outputs import outputs
from solver.results.requested import RequestedNumber
from solver.results.run import Output
from solver.results.view import Axis, Places, View
from solver.typing import Array
from studies.scenes import tables

_NOWHERE = np.zeros(0)


def view_of(scene: tables.SceneFile) -> View:
    """Return the view: map, surfaces, profile and stages."""
    names = scene.stage_names
    released, taken = scene.released, scene.results
    under_load = [name for name in names if name != released]
    grid, profile = taken.map, taken.profile
    surfaces = dict(side.split(".") for side in taken.surfaces) or dict.fromkeys(scene.bodies, "")
    return View(
        x=tables.positions(grid.x) if grid else _NOWHERE,
        y=tables.positions(grid.y) if grid else _NOWHERE,
        depth=tables.positions(profile.depth) if profile else _NOWHERE,
        station=np.array(profile.stations) if profile else _NOWHERE,
        s=tables.positions(taken.s) if taken.s else _NOWHERE,
        profile_body=profile.body if profile else next(iter(surfaces)),
        surfaces=surfaces,
        stages=tuple(names),
        loaded=under_load[-1] if under_load else names[-1],
        unloaded=released,
        symmetric=scene.symmetric,
        axis=Axis(taken.axis.origin, taken.axis.along),
    )


def numbers_of(scene: tables.SceneFile) -> list[RequestedNumber]:
    """Return the numbers that a scene file requests."""
    found = [RequestedNumber(name=n, **each.model_dump()) for n, each in scene.outputs.items()]
    return [
        replace(each, description=f"{each.words}, of the half that is computed")
        if scene.symmetric and each.is_force and not each.description
        else each
        for each in found
    ]


def places_of(scene: tables.SceneFile) -> NamedPlaces:
    """Return the named lines, points and contacts, and the requested numbers."""
    taken = scene.results
    return NamedPlaces(
        lines={
            n: Places(line.body, places(line, taken.samples)) for n, line in taken.lines.items()
        },
        points={n: Places(at.body, np.array(at.at)[:, None]) for n, at in taken.points.items()},
        contacts=[contact.name for contact in scene.contacts],
        numbers=numbers_of(scene),
        samples=0 if "contact" in taken.words else taken.samples,
    )


def output_of(scene: tables.SceneFile, word: str) -> Output:
    """Return the output of a word, with its parameters from the scene file."""
    output = outputs()[word]
    if not output.parametric:
        return output.make
    return output.make(**getattr(scene.results, word).model_dump())


def fatigue_of(table: tables.FatigueTable, view: View) -> Fatigue:
    """Return the output of the table ``fatigue``.

    Raises
    ------
    ModelError
        for an entry that is wrong
    """
    if other := [stage for stage in table.cycle if stage not in view.stages]:
        raise ModelError("cycle", other[0], f"must be one of {', '.join(view.stages)}")
    if not table.residual and not view.unloaded:
        raise ModelError("residual", False, "needs a last stage that releases the bodies")
    made, depth = Fatigue.of(**table.model_dump()), view.depth
    if table.crack and (not depth.size or depth[0] != 0.0):
        raise ModelError("crack", "given", "needs results.profile with a depth from 0 on")
    return made


def places(line: tables.LineResultTable, samples: int) -> Array:
    """Return the points of a line (2, n) [mm]."""
    if line.start is not None and line.end is not None:
        return np.linspace(line.start, line.end, samples).T
    assert line.centre is not None and line.angles is not None
    angle = np.radians(np.linspace(*line.angles, samples))
    circle = np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(np.array(line.centre)[:, None] + line.radius * circle)
