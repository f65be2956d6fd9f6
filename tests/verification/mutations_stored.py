"""Faults on the way from declared loads to stored results.

The audit must notice those of loads, histories and passes; the comparison of every record that a
test makes (`tests.recomputed`) those that break `STORED`.

They are put into loads, histories, steady passes, looks and outputs, one at a time, as those of
`mutations`.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable
from dataclasses import fields, replace
from importlib import import_module
from typing import Any

import numpy as np

import solver.contact.interface
import solver.contact.system
import solver.fem.discretisation
import solver.fem.fields
import solver.loading.walker
import solver.results.acting
import solver.results.fields
import solver.results.figures
import solver.results.increments
import solver.results.places
import solver.results.shakedown
import solver.results.singularity
import solver.rolling.results.plane
import solver.rolling.scenes.rolling_endless
import solver.rolling.scenes.rolling_setup
from solver.contact.candidates import Candidates
from solver.contact.interface import Interface
from solver.fem.fields import Sampler
from solver.fem.loads import Softening, Superposed
from solver.model.loads import InitialStress, Load, Temperature
from solver.model.pairs import ContactPair
from solver.results.acting import ContactResult
from solver.results.fields import Samples, SystemFields
from solver.results.requested import RequestedNumber
from solver.results.run import FinishedRun
from solver.results.shakedown import ShakedownState
from solver.results.view import Axis, Places, View
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.track import Track
from solver.scenes.scene import Scene
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from tests.solver import test_singularity
from tests.verification import test_shakedown
from tests.verification.mutations import Fault, Mutation, Patch

HISTORY, STORED = ("history",), "stored"

FILE = """
name = "blocks"
kinematics = "plane_strain"
thickness = 2.0

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = 300.0
hardening = "isotropic"

[bodies.upper]
material = "steel"
shape = { kind = "rectangle", x = [0, 4], y = [0, 2], size = 0.5 }

[bodies.lower]
material = "steel"
shape = { kind = "rectangle", x = [-1, 5], y = [-3, 0], size = 0.5 }
supports = { bottom = "xy" }

[[contacts]]
name = "face"
slave = "upper.bottom"
master = "lower.top"
friction = 0.3

[[loads]]
body = "upper"
kind = "displacement"
boundary = "top"
x = 0.004
y = -0.008
amplitude = { pressed = 1, lifted = -1, again = 1 }

[[loads]]
body = "lower"
kind = "temperature"
rise = 40.0
expansion = 1.2e-5
modulus_drop = 2e-4
yield_drop = 1e-3
amplitude = { pressed = 1 }

[[loads]]
body = "lower"
kind = "initial_stress"
xx = -30.0

[[stages]]
name = "pressed"
increments = 2
[[stages]]
name = "lifted"
increments = 1
[[stages]]
name = "again"
increments = 2

[results]
samples = 11
map = { x = { start = -0.9, stop = 4.9, num = 9 }, y = { start = -2.9, stop = 3.0, num = 9 } }
[results.lines.down]
body = "lower"
start = [1.1, 0.0]
end = [1.6, -2.9]
[results.points.inside]
body = "lower"
at = [1.3, -0.7]

[outputs.carried]
of = "pressure"
take = "integral"
contact = "face"
stage = "again"
[outputs.touching]
of = "pressure"
take = "extent"
contact = "face"
stage = "again"
[outputs.most]
of = "stress.yy"
take = "minimum"
body = "lower"
stage = "again"
[outputs.along]
of = "stress.xx"
take = "integral"
line = "down"
stage = "again"
"""
PRESSED: dict[str, Any] = {
    "smallest_element": 0.05, "growth": 2.5, "load_step": 0.2, "hardening": "isotropic",
    "friction": 0.3, "load_ratio": 0.6,
}  # fmt: skip
CHABOCHE: dict[str, Any] = {
    "hardening": "chaboche", "back_stresses": ((2e4, 100.0), (5e3, 10.0)), "load_ratio": 0.8,
    "load_step": 0.2,
}  # fmt: skip
LAYERED: dict[str, Any] = {
    "hardening": "layered", "curve": ((0.0, 350.0), (0.005, 430.0)), "load_ratio": 0.8,
    "load_step": 0.2,
}  # fmt: skip
TO_AND_FRO: dict[str, Any] = {
    "element_size": 3.0, "load": "hertz", "traction": 0.5, "direction": "back_and_forth",
    "passes": 2, "load_ratio": 2.5,
}  # fmt: skip
FIT: dict[str, Any] = {
    "accuracy": "draft", "growth": 2.0, "loading": "interference", "friction": 0.3,
}  # fmt: skip


def of_file() -> Scene:
    """Return the scene of two blocks pressed, lifted and pressed again, hot and prestressed."""
    return file_scene(Description("blocks.toml", tomllib.loads(FILE), {}))


def instead(target: Any, name: str, make: Callable[[Any], Any]) -> Fault:
    """Return the fault of what ``make`` makes of an attribute, in its place."""

    def fault(patch: Patch) -> None:
        patch.setattr(target, name, make(getattr(target, name)))

    return fault


def times(target: Any, name: str, factor: float) -> Fault:
    """Return the fault of a function whose value is multiplied."""
    return instead(target, name, lambda old: lambda *a, **k: factor * old(*a, **k))


# -- declared loads ------------------------------------------------------------------------------


def eigenstrains_times(kind: type[Load], factor: float) -> Fault:
    def make(old: Any) -> Any:
        def other(part: Any) -> Superposed:
            found = old(part)
            factors = [factor if isinstance(load, kind) else 1.0 for load in found.cases]
            return Superposed(found.cases, found.fields * np.array(factors))

        return other

    return instead(solver.fem.discretisation, "eigenstrains", make)


def less_interference(old: Any) -> Any:
    def half(self: ContactPair, time: float) -> float:
        return self.gap + (old(self, time) - self.gap) / 2

    return half


def moved_half_way(old: Any) -> Any:
    def half(part: Any) -> Any:
        found, held = old(part)
        return Superposed(found.cases, found.fields / 2), held

    return half


# -- histories ------------------------------------------------------------------------------------


def friction_kept(old: Any) -> Any:
    """What has touched once has a history of friction, wherever it is now."""

    def kept(self: Any, before: Any, span: float, **options: Any) -> Any:
        after = old(self, before, span, **options)
        both = zip(before, after, strict=True)
        return tuple(replace(a, touching=b.touching | a.touching) for b, a in both)

    return kept


def lost_at_a_branch(*names: str) -> Fault:
    """Internal variables of these names are zero where a walk goes on from another."""

    def make(old: Any) -> Any:
        def along(self: Any, walk: Any, program: Any, first: int, end: int) -> Any:
            now = walk.point.now
            if first and end == program.count:
                plastic = tuple(
                    replace(p, **{f.name: 0 * getattr(p, f.name) for f in fields(p)
                                  if f.name in names})
                    for p in now.state.plastic
                )  # fmt: skip
                both = zip(now.responses, plastic, strict=True)
                now = replace(
                    now,
                    state=replace(now.state, plastic=plastic),
                    responses=tuple(r._replace(state=p) for r, p in both),
                )
                walk = replace(walk, point=replace(walk.point, now=now))
            return old(self, walk, program, first, end)

        return along

    return instead(solver.loading.walker.Walker, "_along", make)


# -- steady passes --------------------------------------------------------------------------------


def no_inflow(old: Any) -> Any:
    def virgin(track: Any, material: Any, load: Any, before: Any, *rest: Any, **how: Any) -> Any:
        return old(track, material, load, track.rows.virgin(material), *rest, **how)

    return virgin


def always_ahead(old: Any) -> Any:
    def forward(track: Any, material: Any, load: Any, ways: Any, **options: Any) -> Any:
        return old(track, material, load, itertools.repeat(1), **options)

    return forward


def not_turned(track: Track) -> Any:
    return np.arange(track.part.weights.size), np.arange(track.part.X.shape[1])


def first_pass_last(old: Any) -> Any:
    return lambda traces, cycle: old([traces[0]] * len(traces), cycle)


# -- places ---------------------------------------------------------------------------------------


def one_element_aside(old: Any) -> Any:
    def aside(part: Any, x: Any) -> Any:
        element, point, local = old(part, x)
        return (element + 1) % part.basis.mesh.nelements, point, local

    return aside


def sampled_aside(patch: Patch) -> None:
    """No run shares what is sampled, neither a right run's with this one nor the other way."""
    instead(solver.fem.fields, "_locate", one_element_aside)(patch)
    patch.setattr(solver.contact.system, "sampler", Sampler)


def deeper(old: Any) -> Any:
    return lambda self, s, depth: old(self, s, 1.02 * depth)


def shear_of_mandel(old: Any) -> Any:
    """Shear components keep the factor sqrt(2) of Mandel vectors."""
    del old
    return np.array


def without_shear(old: Any) -> Any:
    return lambda mandel: old(mandel * np.reshape([1, 1, 1, 0], (4, *[1] * (mandel.ndim - 1))))


def turned_round(old: Any) -> Any:
    return lambda *a: old(*a)[..., ::-1]


def zero_outside(old: Any) -> Any:
    return lambda self, nodal: np.nan_to_num(old(self, nodal))


def next_node(old: Any) -> Any:
    def shifted(part: Any) -> Any:
        return old(part)[np.roll(np.arange(part.X.shape[1]), 1)]

    return shifted


def loaded_for_unloaded(patch: Patch) -> None:
    patch.setattr(FinishedRun, "unloaded", FinishedRun.loaded)


def other_coordinates(name: str, factor: float) -> Fault:
    told = View.coordinates.fget  # type: ignore[attr-defined]

    def fault(patch: Patch) -> None:
        def scaled(self: Any) -> Any:
            found = told(self)
            return found | {name: factor * found[name]}

        patch.setattr(View, "coordinates", property(scaled))

    return fault


def aside(old: Any) -> Any:
    return lambda self, places, states: old(self, Places(places.body, places.X - 0.05), states)


def other_stages(old: Any) -> Any:
    return lambda self, places, states: old(self, places, states)[::-1]


def at_nodes_times(name: str, factor: float) -> Fault:
    """Return the fault of a field at the nodes that is multiplied."""

    def make(old: Any) -> Any:
        def other(*args: Any) -> Any:
            found = old(*args)
            return found._replace(**{name: factor * getattr(found, name)})

        return other

    return instead(SystemFields, "_recovered", make)


# -- contact --------------------------------------------------------------------------------------


def pressure_times(factor: float) -> Fault:
    def make(old: Any) -> Any:
        return lambda *a, **k: tuple(factor * each for each in old(*a, **k))

    return instead(solver.contact.system.System, "pressure", make)


def acting_otherwise(**changes: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return what makes other members of the `Acting` that a function returns."""

    def make(old: Any) -> Any:
        def other(*args: Any, **options: Any) -> Any:
            found = old(*args, **options)
            own = {name: change(getattr(found, name)) for name, change in changes.items()}
            return replace(found, **own)

        return other

    return make


def shear_turned(along: Any) -> Any:
    def other(x: Any) -> Any:
        pressure, shear, gap = along(x)
        return pressure, -shear, gap

    return other


def gap_opened(along: Any) -> Any:
    def other(x: Any) -> Any:
        pressure, shear, gap = along(x)
        return pressure, shear, gap + 1e-3

    return other


def later(old: Any) -> Any:
    """What is kept of an increment is told at the next one."""
    return lambda history, times: [None, *old(history, times)[:-1]]


def other_way(old: Any) -> Any:
    def observed(system: Any, converged: Any) -> Any:
        found = old(system, converged)
        turned = {name: (-x, -y, m) for name, (x, y, m) in found.reactions.items()}
        return replace(found, reactions=turned)

    return observed


# -- numbers --------------------------------------------------------------------------------------


def number_times(take: str, factor: float) -> Callable[[Any], Any]:
    def make(old: Any) -> Any:
        def found(self: Any, *args: Any) -> Any:
            first, *rest = old(self, *args)
            return (factor * first if self.take == take else first, *rest)

        return found

    return make


def place_turned(old: Any) -> Any:
    def found(self: Any, *args: Any) -> Any:
        number, *place = old(self, *args)
        return (number, *place[::-1])

    return found


def other_component(patch: Patch) -> None:
    component = solver.results.requested.component
    taken = {"yy": "xx"}
    patch.setattr(
        solver.results.requested, "component", lambda of, name: component(of, taken.get(name, name))
    )


def largest_of_all(old: Any) -> Any:
    return lambda stress, *rest: old(np.abs(stress), *rest)


def wrong_place(old: Any) -> Any:
    return lambda stress, none, X, away: old(stress, none, X[:, ::-1], away)


def longer(old: Any) -> Any:
    return property(lambda self: 1.05 * old.fget(self))


def _file(fault: Fault, *breaks: str) -> Mutation:
    return Mutation(fault=fault, breaks=breaks, scene="file")


def _pressed(fault: Fault, *breaks: str) -> Mutation:
    return Mutation(fault=fault, breaks=breaks, scene="pressed")


def _passed(fault: Fault, *breaks: str, **changes: Any) -> Mutation:
    return Mutation(fault=fault, breaks=breaks, scene="to and fro", parameters=changes)


def _fitted(fault: Fault, *breaks: str) -> Mutation:
    return Mutation(fault=fault, breaks=breaks, scene="fit")


MUTATIONS: dict[str, Mutation] = {
    # declared loads
    "thermal strain doubled": _file(eigenstrains_times(Temperature, 2.0), "law"),
    "initial stress dropped": _file(eigenstrains_times(InitialStress, 0.0), "law"),
    "heat softens nothing": _file(
        instead(Softening, "of", lambda old: lambda part, x, elements=None: None), "law"
    ),
    "interference halved": _fitted(
        instead(ContactPair, "offset", less_interference), "closed_gap", "overlap"
    ),
    "interference forgotten": _fitted(
        instead(
            Interface,
            "facing",
            lambda old: lambda self, u, time=0.0, *, finite=False: self._as_meshed(u, finite),
        ),
        "closed_gap",
        "overlap",
    ),
    "prescribed motion halved": _file(
        instead(solver.fem.discretisation, "prescribed", moved_half_way), "prescribed"
    ),
    # histories
    "friction kept through separation": _file(
        instead(Candidates, "kept", friction_kept), "history"
    ),
    "back stress lost at a branch": Mutation(
        fault=lost_at_a_branch("back"), breaks=HISTORY, scene="branches", parameters=CHABOCHE
    ),
    "layers lost at a branch": Mutation(
        fault=lost_at_a_branch("layer_strain"),
        breaks=HISTORY,
        scene="branches",
        parameters=LAYERED,
    ),
    "hardening lost at a branch": Mutation(
        fault=lost_at_a_branch("accumulated"),
        breaks=HISTORY,
        scene="branches",
        parameters={"hardening": "mixed", "load_ratio": 0.8, "load_step": 0.2},
    ),
    # steady passes
    "inflow of a second pass lost": _passed(
        instead(import_module("solver.rolling.plane.rolling"), "search", no_inflow), "history"
    ),
    "a pass back not mirrored": _passed(
        instead(Layers, "mirrored", lambda old: property(lambda self: self)), "history"
    ),
    "a pass back taken forward": _passed(
        instead(solver.rolling.scenes.rolling_endless, "rolling", always_ahead), "history"
    ),
    "a pass back shown as if it went forward": _passed(
        instead(Track, "mirror", lambda old: property(not_turned)), STORED
    ),
    "residual stress of layers without zz": _passed(times(Layers, "stress", 0.9), STORED),
    "the first pass told as the last": _passed(
        instead(solver.rolling.scenes.rolling_setup, "profiles", first_pass_last), STORED
    ),
    "shear of a wheel against its way": _passed(
        instead(
            solver.rolling.scenes.rolling_endless, "of_wheel", acting_otherwise(along=shear_turned)
        ),
        STORED,
        load="contact",
    ),
    # places
    "sampler one element aside": _pressed(sampled_aside, STORED),
    "depth scaled": _pressed(instead(Axis, "place", deeper), STORED),
    "shear of Mandel vectors": _pressed(
        instead(solver.results.fields, "to_tensor", shear_of_mandel), STORED
    ),
    "von Mises stress without shear": _pressed(
        instead(solver.results.fields, "von_mises", without_shear), STORED
    ),
    "stress in GPa": _pressed(at_nodes_times("stress", 1e-3), STORED),
    "plastic strain in percent": _pressed(at_nodes_times("plastic_strain", 100.0), STORED),
    "strain doubled": _file(at_nodes_times("strain", 2.0), STORED),
    "components of plastic strain doubled": _file(at_nodes_times("plastic_tensor", 2.0), STORED),
    "nodal values of the next node": _pressed(
        instead(solver.contact.system, "recovery", next_node), STORED
    ),
    "maps seen from behind": _pressed(instead(Samples, "on_map", turned_round), STORED),
    "metal where there is none": _pressed(instead(Sampler, "__call__", zero_outside), STORED),
    "the state under load for the released one": _pressed(loaded_for_unloaded, STORED),
    "depth told in m": _pressed(other_coordinates("depth", 1e-3), STORED),
    "x told from the corner": _pressed(other_coordinates("x", -1.0), STORED),
    "lines beside their places": _file(instead(SystemFields, "at_places", aside), STORED),
    "stages in another order": _file(instead(SystemFields, "at_places", other_stages), STORED),
    "displacement against its way": _file(at_nodes_times("displacement", -1.0), STORED),
    # contact
    "pressure on half the circumference": _fitted(pressure_times(2.0), STORED),
    "pressure of a unit of thickness": _file(pressure_times(2.0), STORED),
    "shear on the other body": _fitted(
        instead(solver.results.acting, "of_pair", acting_otherwise(along=shear_turned)), STORED
    ),
    "gap opened": _fitted(
        instead(solver.results.acting, "of_pair", acting_otherwise(along=gap_opened)), STORED
    ),
    "width for half-width": _pressed(
        instead(
            solver.results.acting, "of_pair", acting_otherwise(half_width=lambda half: 2.0 * half)
        ),
        STORED,
    ),
    "peak pressure too high": _pressed(
        instead(solver.results.acting, "of_pair", acting_otherwise(peak=lambda peak: 1.01 * peak)),
        STORED,
    ),
    "forces told an increment later": _file(
        instead(solver.results.increments, "_in_order", later), STORED
    ),
    "reactions as actions": _file(instead(solver.results.increments, "observe", other_way), STORED),
    # numbers
    "integral times 1e-3": _file(
        instead(RequestedNumber, "_found", number_times("integral", 1e-3)), STORED
    ),
    "length of contact times 1.05": _file(instead(ContactResult, "length", longer), STORED),
    "another component sought": _file(other_component, STORED),
    "place of an extreme turned": _file(instead(RequestedNumber, "_found", place_turned), STORED),
    "largest in size for largest": _pressed(
        instead(solver.results.figures, "_most", largest_of_all), STORED
    ),
    "extreme of another node": _pressed(
        instead(solver.results.figures, "_most", wrong_place), STORED
    ),
}


# -- what the audit cannot see ------------------------------------------------------------------


def straight_line(old: Any) -> Any:
    """The next term of a singular stress is left out of its fit."""
    return lambda points, high, *exponents: old(points, high)


UNSEEN: dict[str, tuple[Fault, Callable[[], None]]] = {
    "a singular power by a straight line": (
        instead(solver.results.singularity, "_fit", straight_line),
        lambda: test_singularity.test_the_next_term_of_the_series_is_taken_off(1.0, 2.0),
    ),
    "cycles half open taken for closed": (
        instead(solver.results.shakedown, "CLOSED", lambda old: 10 * old),
        lambda: test_shakedown.test_state_follows_from_where_the_cycles_tend_to(
            [2e-3] * 4, [4e-4] * 4, ShakedownState.RATCHETTING
        ),
    ),
}
"""Faults of what is read out of right fields by a formula of its own, and a test that sees each."""
