"""Solution of a model, and access to its states."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from solver.audit.pairs import untouched
from solver.audit.report import Audit, audit
from solver.contact.state import Converged
from solver.contact.system import System
from solver.errors import ModelError
from solver.fem.nodes import vectors
from solver.fem.rigid import RigidMotion
from solver.fem.window import layered
from solver.late import Late
from solver.linear.solvers import one_thread
from solver.loading.outcome import Cycle, Tally
from solver.loading.program import ROUNDING, Control, Lap, PathControl, Program, Stage
from solver.loading.stepper import Stepper
from solver.loading.walker import Walker
from solver.model.body import Body
from solver.model.model import Model
from solver.model.rigid import RigidBody
from solver.parameters import Positive, require
from solver.results import saved
from solver.results.acting import ContactResult, contact_result
from solver.results.body_fields import BodyValues
from solver.results.cracks import StressIntensity, stress_intensities
from solver.results.cycles import decided, shakedown_of
from solver.results.fields import SystemFields
from solver.results.increments import Observed, observe
from solver.results.mesh_fields import MeshFields, write_vtu
from solver.results.shakedown import Shakedown
from solver.results.view import Places
from solver.tensors import principal, to_tensor
from solver.typing import Array, Ints

_NeighbouringRuns = Late("solver.derivatives.neighbours:NeighbouringRuns")
_LOG = logging.getLogger("solver")
_STAGES = tuple[Stage, ...]
_UNTIL = Literal["shaken_down"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """The states of a model at the ends of its stages, by default ``loaded`` and ``unloaded``.

    Attributes
    ----------
    system : parts and interfaces of the model
    stages : converged states at the ends of the stages, by name
    tally : cost of the run
    history : a few numbers of the initial state and of every increment
    cycles : cycles of repeated stages
    beside : solutions of the models that were solved beside it, first of itself
    """

    system: System
    stages: Mapping[str, Converged]
    tally: Tally
    history: tuple[Observed, ...] = ()
    cycles: tuple[Cycle, ...] = ()
    beside: tuple[Solution, ...] = ()
    _fields: SystemFields = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_fields", SystemFields(self.system))

    @property
    def loaded(self) -> Converged:
        """The state under load."""
        return self._at("loaded")

    @property
    def unloaded(self) -> Converged:
        """The state after unloading, with the bodies separated."""
        return self._at("unloaded")

    def _at(self, stage: str) -> Converged:
        if stage not in self.stages:
            raise ModelError("stage", stage, f"must be one of {', '.join(self.stages)}")
        return self.stages[stage]

    def _known(self, body: str) -> str:
        if body not in self.system.names:
            raise ModelError("body", body, f"must be one of {', '.join(self.system.names)}")
        return body

    def _at_nodes(self, body: str, stage: str) -> BodyValues:
        return self._fields.at_nodes(self._at(stage), self._known(body))

    def nodes(self, body: str) -> Array:
        """Return node positions (dim, n_nodes) of a body [mm]."""
        return self.system.full(self._known(body)).X

    def displacement(self, body: str, stage: str = "unloaded") -> Array:
        """Return nodal displacements (dim, n_nodes) [mm]."""
        u = self.system.displacement(self._known(body), self._at(stage).state)
        return vectors(u, self.system.full(body).dim)

    def stress(self, body: str, stage: str = "unloaded") -> Array:
        """Return recovered nodal stress (4, n_nodes), components xx, yy, zz, xy [MPa].

        Unloaded, this is the residual stress.
        """
        return self._at_nodes(body, stage).stress

    def initial_stress(self, body: str) -> tuple[Array, ...]:
        """Return the initial stress at the integration points, as given and in equilibrium.

        Their difference is the stress that brings the body into equilibrium before any load.

        Returns
        -------
        positions (2, n) [mm], stress as given and stress in equilibrium (4, n), components xx, yy,
        zz, xy [MPa]
        """
        system, body = self.system, self._known(body)
        begun = Stepper(system, Control())
        rest = begun.rest(begun.balanced(system.initial())).now
        x = system.positions(body)
        loads = system.model.body(body).every_load
        fields = (load.initial_stress(x) for load in loads)
        none = np.zeros((system.full(body).components, x.shape[1]))
        given = sum((each for each in fields if each is not None), none)
        return x, given, to_tensor(system.state(body, rest).stress)

    def plastic_strain(self, body: str, stage: str = "unloaded") -> Array:
        """Return the recovered equivalent plastic strain at the nodes (n_nodes,)."""
        return self._at_nodes(body, stage).plastic_strain

    def strain(self, body: str, stage: str = "unloaded") -> Array:
        """Return the recovered nodal strain (4, n_nodes), components xx, yy, zz, xy.

        It is the total strain: elastic, plastic and thermal. In plane stress zz is the strain of
        the thickness.
        """
        return self._at_nodes(body, stage).strain

    def plastic_tensor(self, body: str, stage: str = "unloaded") -> Array:
        """Return the recovered nodal plastic strain (4, n_nodes), components xx, yy, zz, xy."""
        return self._at_nodes(body, stage).plastic_tensor

    def at(self, body: str, places: ArrayLike, stage: str = "unloaded") -> dict[str, Array]:
        """Return the fields of `BodyValues` at places (2, n) [mm] of a body; NaN outside the body.

        They are ``displacement`` (2, n) [mm], ``stress`` (4, n) [MPa] with components xx, yy, zz,
        xy, ``mises`` (n,) [MPa], ``strain`` (4, n), ``plastic_tensor`` (4, n), the plastic strain,
        and ``plastic_strain`` (n,), its accumulated equivalent. Raises `ModelError` for an unknown
        body or stage, or places of another shape.
        """
        X, dim = np.asarray(places, dtype=float), self.system.full(self._known(body)).dim
        if X.ndim != 2 or len(X) != dim:
            raise ModelError("places", X.shape, f"must be positions ({dim}, n) [mm]")
        (found,) = self._fields.at_places(Places(body, X), [self._at(stage)])
        return found._asdict()

    def strained(self, body: str, beyond: float = 0.02, layers: int = 3) -> Ints:
        """Return the numbers of the elements that strain beyond a limit, and layers around them.

        The strain is the largest principal one in the stages. With small strain, they are the
        region for `Body.large_region` of a second solution: name them by the mesh's
        ``with_subdomains``.
        """
        for name, value in {"beyond": beyond, "layers": layers}.items():
            if not value >= 0:
                raise ModelError(name, value, "must be at least 0")
        whole = self.system.full(self._known(body))
        states = [self.system.state(body, converged) for converged in self.stages.values()]
        most = np.max([np.abs(principal(state.strain)[0]) for state in states], axis=(0, 1))
        reached = (most.reshape(whole.weights.shape) > beyond).any(axis=1)
        return np.flatnonzero(layered(whole, np.asarray(reached), layers))

    def contact(self, pair: int = 0, stage: str = "loaded") -> ContactResult:
        """Return pressure, shear, gap and slip at the vertices of the slave of a pair."""
        count = len(self.system.interfaces)
        if not isinstance(pair, int | np.integer) or pair not in range(-count, count):
            allowed = f"must be from 0 to {count - 1}" if count else "the model has no contacts"
            raise ModelError("pair", pair, allowed)
        return contact_result(self.system, self._at(stage), pair)

    def stress_intensities(self, stage: str = "loaded", rings: int = 4) -> list[StressIntensity]:
        """Return K_I and K_II at the tips of all cracks; see `solver.results.cracks`.

        ``rings`` is the number of rings of elements around a tip in the domain of the integral.
        """
        return stress_intensities(self.system, self._at(stage), rings)

    def motion(self, body: str, stage: str = "loaded") -> RigidMotion:
        """Return the motion of a rigid body: x, y [mm] and rotation [rad]."""
        return self._observed(body, stage).motions[body]

    def reaction(self, body: str, stage: str = "loaded") -> tuple[float, float, float]:
        """Return the forces x, y [N] and moment [N mm] on a rigid body, without contact."""
        x, y, moment = self._observed(body, stage).reactions[body]
        return x, y, moment

    def _observed(self, body: str, stage: str) -> Observed:
        known = [rigid.name for rigid in self.system.model.rigid]
        if body not in known:
            allowed = "must be a rigid body: " + (", ".join(known) or "the model has none")
            raise ModelError("body", body, allowed)
        return observe(self.system, self._at(stage))

    def to_vtu(self, folder: str | Path) -> Path:
        """Write fields at the nodes as one .vtu per stage into a folder, for ParaView.

        Returns the path of the .pvd file that lists them. See
        `solver.results.mesh_fields.to_meshio` for the names of the fields.
        """
        return write_vtu(self.mesh_fields(), Path(folder))

    def mesh_fields(self) -> MeshFields:
        """Return the fields at the nodes of all bodies at all stages."""
        return self._fields.on_mesh(self.stages)

    def save(self, path: str | Path) -> None:
        """Write the model and its states to a file, for `load`."""
        content = {name: getattr(self, name) for name in ("stages", "tally", "history", "cycles")}
        saved.write(Path(path), {"model": self.system.model, **content})

    @classmethod
    def load(cls, path: str | Path) -> Solution:
        """Return the solution that `save` has written with the same version of the solver.

        The file is a pickle, which can run code: load only files that you saved yourself.
        """
        content = saved.read(Path(path))
        return cls(system=System(content.pop("model")), **content)

    def shakedown(self) -> Shakedown:
        """Return the shakedown state to which the cycles tend, and the plastic strain of a cycle.

        Raises
        ------
        ModelError
            if no stage is repeated
        """
        if not self.cycles:
            raise ModelError("stages", list(self.stages), "must have some with a cycle")
        return shakedown_of(self.cycles, self.system.laws)

    def audit(self, stage: str = "loaded") -> Audit:
        """Return the audit: figures of a state, violated conditions and warnings.

        The audit of the state under load includes the state after unloading.
        """
        after = self.stages.get("unloaded") if stage == "loaded" else None
        tally = self.tally
        every = self.stages.values()
        found = audit(self.system, self._at(stage), after, tally.dissipation, tally.lost, every)
        own = self.system.model.doubts + untouched(self.system, self.stages.values())
        return replace(found, warnings=own + found.warnings)


def solve(
    model: Model,
    *,
    load: float | None = None,
    stages: Sequence[Stage] = (),
    until: _UNTIL | None = None,
    control: PathControl | None = None,
    linear_solver: str = "auto",
    progress: Callable[[float], None] | None = None,
    beside: Mapping[str, Model] | None = None,
) -> Solution:
    """Load a model to a multiple of its loads, unload and separate the bodies; return both states.

    The logger ``solver`` reports each increment at level INFO, and numbers of the model that look
    like mistakes (`Model.doubts`) as warnings.

    Parameters
    ----------
    load : load factor, the multiple of all loads of the model; by default 1
    stages : stages to solve instead of ``load``, for loads with amplitudes; the solution has the
        states at their ends. The stages of a cycle (`Stage.cycle`) follow one another, and those of
        the next cycle have the same names
    until : ``shaken_down`` leaves out the cycles after the shakedown state is decided; loads must
        be the same at the ends of all cycles
    control : increments and tolerances; by default twenty increments of loading
    linear_solver : ``auto``, ``pardiso`` or ``superlu``
    progress : function that is called after each increment with the completed fraction of the
        increments, at most 1; an exception that it raises stops the computation
    beside : almost equal models by name, which follow the model linearly: see `solver.derive`

    Raises
    ------
    ModelError
        if the input is wrong
    LimitLoad
        if the structure has no equilibrium at this load
    NotConverged
        if an increment failed although an equilibrium may exist
    """
    given = ("model", model, Model), ("load", load, Positive | None), ("stages", stages, _STAGES)
    chosen = ("control", control, PathControl | None), ("until", until, _UNTIL | None)
    for name, value, kind in (*given, *chosen):
        require(name, value, kind)
    stages = tuple(stages)
    if load is not None and stages:
        raise ModelError("load", load, "must be left out if stages are given")
    load = 1.0 if load is None else load
    names = [stage.name for stage in stages if stage.cycle < 2]
    names += [f"{stage.name}_before" for stage in stages if stage.cycle == 2]
    if len(set(names)) < len(names):
        raise ModelError("stages", names, "must have different names")
    if until:
        last = {stage.cycle: stage.target for stage in stages if stage.cycle}
        if not last:
            raise ModelError("until", until, "needs stages with a cycle")
        _check_ends(model, list(last.values()))
    control = control or PathControl(load_step=load / 20)
    program = Program(laps=(Lap(stages),)) if stages else control.program(load)
    for body in () if stages else model.bodies:
        if any(load.amplitude is not None and load.varies for load in body.every_load):
            allowed = "must be absent without stages: solve then increases a load factor"
            raise ModelError("amplitude", body.name, allowed)
    for doubt in model.doubts:
        _LOG.warning("%s", doubt)
    with one_thread():
        system = System(model, linear_solver)
        systems = {name: System(each, linear_solver) for name, each in (beside or {}).items()}
    follow = _IncrementCount(program, progress)
    program = replace(program, beside=(program,) * len(systems))
    followers = _NeighbouringRuns(system, systems) if systems else None
    ends = partial(decided, laws=system.laws) if until else None
    watch = partial(observe, system)
    walker = Walker(system, control, watch=watch, report=follow, until=ends, followers=followers)
    (outcome,) = walker.walk([program])
    if outcome.error is not None:
        raise outcome.error
    solution = Solution(
        system=system,
        stages=outcome.points,
        tally=outcome.tally,
        history=outcome.history,
        cycles=outcome.cycles,
    )
    each = zip((system, *systems.values()), outcome.beside, strict=False)
    found = (Solution(system=own, stages=at.points, tally=at.tally, cycles=at.cycles)
             for own, at in each)  # fmt: skip
    return replace(solution, beside=tuple(found))


def _check_ends(model: Model, times: Sequence[float]) -> None:
    """Raise `ModelError` if loads differ at the ends of cycles, some of which may be left out."""
    bodies: list[Body | RigidBody] = [*model.bodies, *model.rigid]
    of: list[tuple[str, Callable[[float], float]]] = [
        (f"{load.name} of {body.name}", float if load.moves else load.factor)
        for body in bodies
        for load in body.every_load
        if load.varies
        and getattr(load, "value", True)
        and (any(load.components.values()) or not load.components)  # held still
    ]
    for k, contact in enumerate(model.contacts):
        of.append((f"contacts[{k}].interference", contact.offset))
        of += [(f"contacts[{k}].presence", each.at) for each in (contact.presence,) if each]
    of += [(f"axle of {body.name}", float) for body in model.bodies if body.axle]
    for name, value in of:
        ends = [value(time) for time in times]
        if np.ptp(ends) > ROUNDING * max(1.0, *np.abs(ends)):
            allowed = f"must be the same at the ends of all cycles: {name}"
            raise ModelError("until", [float(f"{end:.6g}") for end in ends], allowed)


class _IncrementCount:
    """Counts increments, with parts of cut ones, and reports their share of the planned ones."""

    def __init__(self, program: Program, progress: Callable[[float], None] | None) -> None:
        self._planned, self._done = program.count, 0
        self._progress = progress

    def __call__(self) -> None:
        self._done += 1
        _LOG.info("increment %d, %d planned", self._done, self._planned)
        if self._progress is not None:
            self._progress(min(self._done / self._planned, 1.0))
