"""The model of the rolling scene, half-space and wheel, and the work of its loading path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from skfem import Mesh

from solver.loading.program import HALVINGS
from solver.materials.elastic_plastic import Material
from solver.mesh.grids import grid, grid_size, mapped, merged, within
from solver.model.amplitude import Amplitude
from solver.model.body import Axle, Body
from solver.model.loads import TravellingPressure
from solver.model.model import Model
from solver.rolling.plane.lines import half_space_nodes, rim_elements, track_lines, wheel_nodes
from solver.rolling.plane.track import CONTACT, half_space_body, standing_pressure
from solver.rolling.scenes.rolling import RollingParameters
from solver.scenes.scene import Effort
from solver.scenes.sketch import Sketch
from solver.typing import Array

_DECIDED = 3
"""Smallest number of passes after which a shakedown state may be decided."""


def _lines(parameters: RollingParameters) -> tuple[Array, Array]:
    """Return x and y of the grid lines of the half-space [mm]."""
    p, a = parameters, parameters.half_width
    if p.endless:
        return track_lines(p.mesh_width, p.element_size, p.growth)
    return half_space_nodes(p.fine, p.half_space_size * a, a, p.element_size, p.growth)


def _half_space(parameters: RollingParameters) -> Body:
    x, y = _lines(parameters)
    loads: tuple[TravellingPressure, ...] = ()
    if parameters.load == "hertz":
        schedule = parameters.schedule
        ratio = parameters.friction * parameters.traction
        pressure = TravellingPressure(
            boundary="top",
            half_width=parameters.half_width,
            peak=parameters.peak_pressure,
            amplitude=schedule.load,
            position=schedule.position,
            shear_ratio=schedule.way.times(ratio),
        )
        loads = (pressure,)
    return Body(
        name="half_space",
        mesh=within(grid(x, y), "track", ["top"], x=(-parameters.fine, parameters.fine)),
        material=parameters.material(),
        element=parameters.element,
        supports={"left": "x", "right": "x", "bottom": "xy"},
        loads=loads,
    )


def _ring(R: float, reach: float, h: float, turned: float) -> Mesh:
    """Return the mesh of a wheel above (0, 0), turned by an angle [rad]; see `wheel_nodes`."""
    angle, radius = wheel_nodes(R, reach, h)
    ring = within(grid(angle, radius), "rim", ["top"], x=(-reach / R, reach / R))

    def around(p: np.ndarray) -> np.ndarray:
        angle = p[0] - turned
        return np.stack([-p[1] * np.sin(angle), R - p[1] * np.cos(angle)])

    return merged(mapped(ring, around))


def wheel_body(
    axle: Axle, reach: float, h: float, material: Material, element: str = "quad8"
) -> Body:
    """Return a wheel on its axle; see `wheel_nodes`."""
    return Body(
        name="wheel",
        mesh=_ring(axle.radius, reach, h, -axle.turned),
        material=material,
        element=element,
        supports={"bottom": "xy"},
        axle=axle,
    )


def _wheel(parameters: RollingParameters) -> Body:
    R, turned = parameters.radius, parameters.wheel_turned
    schedule = parameters.schedule
    position = schedule.position
    full_slip = parameters.friction * parameters.force
    rotation: Amplitude | None = None
    if parameters.traction == 1.0:  # locked
        rotation = Amplitude(position.time, np.full_like(position.value, -turned))
    elif parameters.guided:
        # without friction no moment turns the wheel: its rotation is prescribed as rolling
        turning = (1 - parameters.given_creepage) * position.value / R
        rotation = Amplitude(position.time, -turned - turning)
    axle = Axle(
        centre=(0.0, R),
        radius=R,
        force=schedule.load.times(parameters.force),
        moment=schedule.drive.times(R * parameters.traction * full_slip),
        position=position,
        rotation=rotation,
        turned=-turned,
    )
    p = parameters
    return wheel_body(axle, p.reach, p.element_size, p.wheel_material, p.element)


def sketch(parameters: RollingParameters) -> Sketch | None:
    """Return the bodies of steady passes, the load at x = 0; None of passes by increments."""
    p = parameters
    if not p.endless:
        return None
    body = half_space_body(*_lines(p), CONTACT * p.mesh_width, p.material().elasticity)
    half_space = replace(body, material=p.material())
    if p.load == "hertz":
        pressure = standing_pressure(p.peak_pressure, p.friction * p.traction, p.half_width)
        return Sketch((replace(half_space, loads=(pressure,)),))
    still = Amplitude.constant(0.0)
    axle = Axle(
        centre=(0.0, p.radius), radius=p.radius, force=Amplitude.constant(p.force), moment=still,
        position=still,
    )  # fmt: skip
    wheel = wheel_body(axle, p.widest.reach, p.element_size, p.wheel_material)
    return Sketch((wheel, half_space), ((("half_space", "contact"), ("wheel", "rim")),))


def model(parameters: RollingParameters) -> Model:
    """Return the half-space, and the wheel unless ``load`` is ``hertz``."""
    half_space = _half_space(parameters)
    if parameters.load == "hertz":
        return Model(bodies=(half_space,))
    contact = parameters.contact(
        slave=("half_space", "track"), master=("wheel", "rim"), sliding="finite"
    )
    return Model(bodies=(_wheel(parameters), half_space), contacts=(contact,))


def effort(parameters: RollingParameters, passes: Sequence[float]) -> Effort:
    """Return the work of rolling up to the largest number of passes."""
    p, n = parameters, int(max(passes))
    track = grid_size(*_lines(p), p.element)
    # x is held at both sides, x and y at the bottom, which shares its ends with the sides
    elements, unknowns = track.elements, 2 * (track.nodes - track.up - track.along + 1)
    if p.load == "contact":
        ring = wheel_nodes(p.radius, p.widest.reach, p.element_size)
        elements += grid_size(*ring, p.element).elements
    if p.endless:  # passes are steady: the wheel is a compliance
        least = min(n, _DECIDED) if p.until == "decided" else n
        return Effort(elements=elements, unknowns=unknowns, increments=least, most_increments=n)
    if p.load == "contact":
        rim = range(rim_elements(p.reach, p.element_size) + 1)
        unknowns += 2 * grid_size(rim, [0.0], p.element).along
        unknowns += 1 if p.guided else 2  # height of the hub, and its rotation
    schedule = p.schedule
    fixed = schedule.press * (1 + schedule.driven) + schedule.release
    rolled = 2 * schedule.half_steps
    # the first pass is repeated for each halving; the other passes use the last halving
    times = [2**k for k in range(HALVINGS + 1 if p.advance_tolerance else 1)]
    first = sum(fixed + rolled * each for each in times)
    return Effort(
        elements=elements,
        unknowns=unknowns,
        increments=n * (fixed + rolled),
        most_increments=first + (n - 1) * (fixed + rolled * times[-1]),
    )
