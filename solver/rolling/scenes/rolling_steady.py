"""Steady passes of the rolling scene: track, rim and loads made from its parameters."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

from solver.errors import LimitLoad, ModelError, NotConverged
from solver.linear.threads import one_thread
from solver.loading.bearing import too_much_shear
from solver.materials.material import Material
from solver.memory import kept
from solver.model.amplitude import Amplitude
from solver.model.friction import effective_friction
from solver.model.motion import Axle
from solver.rolling.layers import Layers
from solver.rolling.load import PassingLoad
from solver.rolling.passing import Pass, SolveBudget
from solver.rolling.plane.rim import Rim
from solver.rolling.plane.rolling import rolling
from solver.rolling.plane.search import search
from solver.rolling.plane.track import Track, track_of
from solver.rolling.plane.wheel import RollingWheel
from solver.rolling.scenes.rolling_model import wheel_body
from solver.rolling.scenes.rolling_parameters import RollingParameters
from solver.typing import Array

_PARTS, _TOLERANCE = 4, 0.01
"""Increments between two points of a row, and tolerance, of a pass on a coarser mesh."""


def steady_passes(
    parameters: RollingParameters,
    reach: float = 1.0,
    parts: int | None = None,
    budget: SolveBudget | None = None,
) -> Iterator[Pass[Layers]]:
    """Yield the passes in their order.

    Parameters
    ----------
    reach : ratio of the size of the window to the usual size
    parts : increments between two points of a row, or None for the usual number
    budget : counts the solves of each pass, as in `rolling`
    """
    p = parameters
    track = track_for(p, reach)
    block = p.block  # equal passes are one object
    load_of = {id(own): load_on(track, p, own) for own in block}
    loads = itertools.cycle(load_of[id(own)] for own in block)
    guess = _first_guess(p, reach)
    yield from rolling(
        track, p.material(), loads, p.directions, guess=guess, parts=parts, budget=budget
    )


def _first_guess(parameters: RollingParameters, reach: float) -> Array | None:
    """Return the strain of the first pass as found with elements of twice the side, or None.

    Half of Newton's steps only come near the solution; on the coarser mesh they cost a fifth.
    """
    p = parameters
    try:
        coarse = replace(p, element_size=2 * p.element_size, growth=p.growth**2)
        track = track_for(coarse, reach)
        with one_thread():
            found = search(
                track, p.material(), load_on(track, coarse, coarse.of_pass(0)),
                track.rows.virgin(p.material()), _first_guess(coarse, reach), parts=_PARTS,
                tolerance=_TOLERANCE,
            )  # fmt: skip
    except LimitLoad:
        raise
    except (NotConverged, ModelError):
        return None
    return track_for(p, reach).rows.interpolated(found.strain, track.rows)


def track_for(parameters: RollingParameters, reach: float = 1.0) -> Track:
    """Return the half-space, built once in a process for each mesh."""
    p = parameters
    return track_of(p.mesh_width, p.element_size, p.growth, p.material().elasticity, reach)


def rim_of(parameters: RollingParameters) -> Rim:
    """Return the rim of the wheel, condensed once in a process for each wheel."""
    p = parameters
    return _rim(p.radius, p.widest.reach, p.element_size, p.wheel_material)


@kept
def _rim(radius: float, reach: float, h: float, material: Material) -> Rim:
    still = Amplitude.constant(0.0)
    axle = Axle(centre=(0.0, radius), radius=radius, force=still, moment=still, position=still)
    return Rim(wheel_body(axle, reach, h, material), "rim")


def load_on(track: Track, run: RollingParameters, parameters: RollingParameters) -> PassingLoad:
    """Return the load of a pass, which moves along +x.

    Parameters
    ----------
    run : parameters of the run, for the rim of its widest contact
    parameters : those of the pass

    Raises
    ------
    LimitLoad
        if its prescribed shear is above the shear strength of the material
    """
    p = parameters
    if p.load == "hertz":
        shear = p.friction * abs(p.traction) * p.peak_pressure
        if (limit := too_much_shear(p.material(), shear)) is not None:
            raise limit
        return track.hertz(p.peak_pressure, p.friction * p.traction, p.half_width)
    friction = effective_friction(p.friction)
    return RollingWheel(
        track,
        rim_of(run),
        friction=p.friction_part,
        force=p.force,
        strength=p.material().shear_yield_stress,
        drive=None if p.guided else p.traction * friction * p.force,
        creepage=1.0 if p.traction == 1.0 else p.given_creepage,
    )
