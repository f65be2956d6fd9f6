"""Build model and loading history from the tables of a scene file."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from solver.errors import ModelError
from solver.loading.program import Lap, Program, Stage, load_and_release, load_cycles
from solver.materials.law import Law
from solver.mesh.grids import marked, within, without
from solver.mesh.opening import opened
from solver.model.amplitude import Amplitude
from solver.model.body import Body
from solver.model.friction import FRICTION, FrictionLaw
from solver.model.loads import LOADS, Load
from solver.model.model import Model
from solver.model.pairs import ContactPair, Link
from solver.model.rigid import RigidBody
from solver.model.tabulated import Tabulated
from solver.scenes.material_parameters import MaterialParameters
from studies.errors import StudyError, nearest
from studies.scenes import tables
from studies.scenes.meshfile import MeshFile
from studies.scenes.shape_tables import ArcTable, mesh_of
from studies.scenes.table import TabulatedTable

T = TypeVar("T")
_MOTIONS = ("x", "y", "rotation")
_NOT_OF_MODEL = (
    "name", "summary", "parameters.", "derived.", "stages", "loading", "results.", "outputs.",
    "singular", "allow", "accuracy", "checks", "advice",
)  # fmt: skip
"""Beginnings of the names of entries on which bodies, supports and contact do not depend."""


@dataclass
class Builder:
    """Builds the model of a scene and collects all mistakes.

    Attributes
    ----------
    scene : its tables, for values of its parameters
    meshes : mesh files by the name that bodies give; None if they are not at hand
    mistakes : the mistakes found so far
    absent : names of wrong tables, such as ``bodies.pin``, which are replaced by stand-ins
    """

    scene: tables.SceneFile
    meshes: Mapping[str, MeshFile] | None
    mistakes: list[StudyError] = field(default_factory=list)
    absent: Collection[str] = ()
    _boundaries: dict[str, list[str]] = field(default_factory=dict, init=False)
    _regions: dict[str, list[str]] = field(default_factory=dict, init=False)

    def model(self) -> Model | None:
        """Return the model, or None if there are mistakes, which are those of all tables."""
        from solver.model.model import Model
        from solver.model.singular import SingularPoint

        t = self.scene
        laws = {
            name: self.attempt(f"materials.{name}", partial(law_of, table))
            for name, table in t.materials.items()
        }
        bodies = [self._body(name, body, laws) for name, body in t.bodies.items()]
        rigid = [self._rigid(name, body) for name, body in t.rigid.items()]
        contacts = [self._contact(k, contact) for k, contact in enumerate(t.contacts)]
        links = [self._link(k, link) for k, link in enumerate(t.links)]
        for side in t.results.surfaces:
            self._has_boundary("results.surfaces", *side.split("."))
        for k, stage in enumerate(t.stages):
            for side in stage.remove:
                self._has_region(f"stages[{k}].remove", *side.split("."))
        if self._is_incomplete():
            return None
        return self.attempt(
            "",
            lambda: Model(
                bodies=tuple(filter(None, bodies)),
                rigid=tuple(filter(None, rigid)),
                contacts=tuple(filter(None, contacts)),
                links=tuple(filter(None, links)),
                singular=tuple(SingularPoint(**each.model_dump()) for each in t.singular),
            ),
        )

    def attempt(self, where: str, make: Callable[[], T]) -> T | None:
        """Return the result of a function; None if it fails, which is added to the mistakes."""
        try:
            return make()
        except ModelError as error:
            name = f"{where}.{error.field}" if where else error.field
            self.mistakes.append(StudyError(name, error.value, error.allowed))
            return None

    def _is_incomplete(self) -> bool:
        """Tell whether a part of the model is absent or wrong."""
        fields = [*self.absent, *(mistake.field for mistake in self.mistakes)]
        return any(not field.startswith(_NOT_OF_MODEL) for field in fields)

    # -- bodies ------------------------------------------------------------------------------

    def _body(
        self, name: str, table: tables.BodyTable, laws: Mapping[str, Law | None]
    ) -> Body | None:
        from solver.model.body import Body

        where = f"bodies.{name}"
        no_file = (
            table.mesh is not None and self.meshes is not None and table.mesh not in self.meshes
        )
        if no_file or where in self.absent or (table.mesh is None and table.shape is None):
            return None  # reported already
        at = where if table.shape is None else f"{where}.shape"
        given = self.attempt(at, lambda: _given_mesh(table, self.meshes))
        mesh = self.attempt(where, lambda: _placed_mesh(given, table)) if given else None
        if mesh is None:
            return None
        self._boundaries[name] = list(mesh.boundaries or {})
        self._regions[name] = list(mesh.subdomains or {})
        supports = {
            boundary: held
            for boundary, held in table.supports.items()
            if self._has_boundary(f"{where}.supports.{boundary}", name, boundary)
        }
        loads = [
            self._load(k, load)
            for k, load in enumerate(self.scene.loads)
            if load.body == name
            and self._has_boundary(f"loads[{k}].boundary", name, getattr(load, "boundary", None))
        ]
        law = laws.get(table.material)
        if law is None:
            return None
        return self.attempt(
            where,
            lambda: Body(
                name=name,
                mesh=mesh,
                material=law,
                kinematics=self.scene.kinematics,
                element=table.element or default_element(mesh, table.strain),
                strain=table.strain,
                large_region=table.large_region,
                cracks=tuple(table.cracks),
                thickness=self.scene.thickness,
                supports=supports,
                loads=(*filter(None, loads), *self._removals(name)),
            ),
        )

    def _removals(self, body: str) -> list[Load]:
        """Return the removals of regions of a body, each in the stage that removes it."""
        from solver.model.loads import Removal

        found: dict[str, Amplitude] = {}
        for k, (stage, _) in enumerate(self.scene.passages):
            for side in stage.remove:
                found.setdefault(side, Amplitude(np.array([k, k + 1.0]), np.array([0.0, 1.0])))
        sides = {side: side.split(".") for side in found}
        return [
            Removal(region=region, amplitude=found[side])
            for side, (name, region) in sides.items()
            if name == body and region in self._regions[body]
        ]

    def _rigid(self, name: str, table: tables.RigidTable) -> RigidBody | None:
        from solver.model.rigid import Moved, Pushed, RigidBody, RigidSurface, arc

        if f"rigid.{name}" in self.absent:
            return None
        self._boundaries[name] = list(table.surfaces)
        surfaces = {}
        for each, surface in table.surfaces.items():
            if isinstance(surface, ArcTable):
                start, end = np.radians(surface.angles)
                surfaces[each] = arc(surface.centre, surface.radius, (start, end), surface.edges)
                continue
            chain = self.attempt(f"rigid.{name}.surfaces.{each}", surface.chain)
            if chain is None:
                return None
            surfaces[each] = RigidSurface(points=chain)
        motions: dict[str, Moved | Pushed] = {}
        for axis in _MOTIONS:
            motion: tables.MotionTable = getattr(table, axis)
            amplitude = self._amplitude(f"rigid.{name}.{axis}.amplitude", motion.amplitude)
            if motion.pushed is not None:
                locked = self.scene.end_of(motion.locked) if motion.locked else math.inf
                motions[axis] = Pushed(value=motion.pushed, amplitude=amplitude, locked=locked)
            else:
                moved = motion.moved or 0.0
                moved = math.radians(moved) if axis == "rotation" else moved
                motions[axis] = Moved(value=moved, amplitude=amplitude)
        return self.attempt(
            f"rigid.{name}",
            lambda: RigidBody(
                name=name,
                surfaces=surfaces,
                centre=table.centre,
                thickness=self.scene.thickness,
                **motions,
            ),
        )

    def _has_boundary(self, field: str, body: str, boundary: str | None) -> bool:
        """Tell whether a body has a boundary, and add a mistake if not; None needs no boundary."""
        return self._has("boundary", self._boundaries, field, body, boundary)

    def _has_region(self, field: str, body: str, region: str) -> bool:
        """Tell whether a body has a region, and add a mistake if not."""
        return self._has("region", self._regions, field, body, region)

    def _has(
        self, what: str, of: Mapping[str, list[str]], field: str, body: str, name: str | None
    ) -> bool:
        known = of.get(body)
        if name is None or known is None or name in known:
            return True
        allowed = f"must name a {what} of {body}: {', '.join(known) or 'it has none'}"
        self.mistakes.append(StudyError(field, name, allowed + nearest(name, known)))
        return False

    # -- loads and contact -------------------------------------------------------------------

    def _load(self, k: int, table: tables.LoadTable) -> Load | None:
        where, files = f"loads[{k}]", self.meshes
        if files is not None and any(t.file not in files for t in table.tabulated.values()):
            return None  # reported already
        every = {"amplitude": None, **table.amplitudes}
        courses = {name: self._amplitude(f"{where}.{name}", own) for name, own in every.items()}
        return self.attempt(where, lambda: load_of(table, courses, files))

    def _contact(self, k: int, table: tables.ContactTable) -> ContactPair | None:
        from solver.model.pairs import ContactPair

        slave, master = (tuple(side.split(".")) for side in (table.slave, table.master))
        for side, (body, boundary) in (("slave", slave), ("master", master)):
            self._has_boundary(f"contacts[{k}].{side}", body, boundary)
        amplitude = self._amplitude(f"contacts[{k}].amplitude", table.amplitude)
        presence = None
        if table.active is not None and self.scene.passages:
            there = [float(stage.name in table.active) for stage, _ in self.scene.passages]
            presence = Amplitude(np.arange(1.0 + len(there)), np.array([*there[:1], *there]))
        return self.attempt(
            f"contacts[{k}]",
            lambda: ContactPair(
                slave=(slave[0], slave[1]),
                master=(master[0], master[1]),
                friction=friction_of(table),
                sliding=table.sliding,
                gap=table.gap,
                interference=table.interference,
                amplitude=amplitude,
                presence=presence,
            ),
        )

    def _link(self, k: int, table: tables.LinkTable) -> Link | None:
        from solver.model.pairs import Link

        sides = [(body, boundary) for body, _, boundary in (s.partition(".") for s in table.sides)]
        for name, (body, boundary) in zip(("slave", "master"), sides, strict=False):
            self._has_boundary(f"links[{k}].{name}", body, boundary)
        given = table.model_dump(include={"rigid", "components", "distributed"})
        return self.attempt(
            f"links[{k}]",
            lambda: Link(
                slave=sides[0],
                master=sides[1] if table.master else None,
                stiffness=table.stiffness or math.inf,
                **given,
            ),
        )

    def _amplitude(self, where: str, given: tables.Amplitude | None) -> Amplitude | None:
        """Return a number over time; stage k ends at time k. Its entry in the file is ``where``."""
        passages = self.scene.passages
        if not passages:
            if given is not None:
                allowed = "needs stages: with loading all loads grow together"
                self.mistakes.append(StudyError(where, given, allowed))
            return None
        times, values = [0.0], [0.0]
        courses: dict[str, list[tuple[float, float]]] = {}
        for k, (stage, cycle) in enumerate(passages):
            if cycle <= 2:  # all later ones begin as the second does
                usual = 1.0 if given is None else values[-1]
                ends = stage.release and where.endswith(".amplitude")  # positions stay
                factor = (given or {}).get(stage.name, 0.0 if ends else usual)
                field = f"{where}.{stage.name}"
                found = self.attempt(field, partial(course_of, factor, values[-1], self.meshes))
                known = [(1.0, values[-1])] if found is None else found.tolist()
                courses[stage.name] = known
            for time, value in courses[stage.name]:
                times.append(k + time)
                values.append(value)
        return Amplitude(np.array(times), np.array(values))


def course_of(
    given: float | tables.Course | tables.CourseTable,
    before: float | None,
    files: Mapping[str, MeshFile] | None,
) -> NDArray[np.float64]:
    """Return the share of a stage (0-1] and the load factor of each knot of a course (n, 2).

    Parameters
    ----------
    before : load factor at the beginning of the stage; None if not known
    files : files beside the scene; None if they are not at hand

    Raises
    ------
    ModelError
        for a table that is none, or that does not begin with the factor before
    """
    if isinstance(given, tables.CourseTable):
        if files is None or given.file not in files:
            return np.array([[1.0, before or 0.0]])  # reported already
        course = files[given.file].columns("time", given.column)
    else:
        course = np.array([[1.0, given]] if isinstance(given, int | float) else given)
    time, factor = course.T
    if time[0] < 0 or not (np.diff(time) > 0).all() or not time[-1] > 0:
        raise ModelError("time", time.tolist(), "must increase from 0 or later")
    if time[0] == 0:
        if before is not None and not math.isclose(factor[0], before, rel_tol=1e-9, abs_tol=1e-12):
            allowed = f"must be {before:g}, with which the stage begins, or left out"
            raise ModelError("factor", float(factor[0]), allowed)
        course = course[1:]
    return course / [time[-1], 1.0]


def program_of(scene: tables.SceneFile, files: Mapping[str, MeshFile] | None = None) -> Program:
    """Return the loading history; an increment ends where an amplitude bends."""
    loading = scene.loading
    if loading is not None:
        step = loading.step or loading.factor
        if loading.cycles is None:
            return load_and_release(loading.factor, step, loading.release_increments)
        return load_cycles(loading.factor, step, loading.release_increments, loading.cycles)
    bends = _bends(scene, files)
    stages = tuple(
        Stage(
            name=stage.name,
            target=float(k + 1),
            steps=stage.increments,
            apart=stage.release,
            turns=k > 0,
            stops=tuple(k + share for share in bends.get(stage.name, ())),
            cycle=cycle,
        )
        for k, (stage, cycle) in enumerate(scene.passages)
    )
    return Program(laps=(Lap(stages),), place=_place(scene.passages))


def increments_of(scene: tables.SceneFile, files: Mapping[str, MeshFile] | None = None) -> int:
    """Return the largest number of increments that the loading history may have, not making it."""
    loading = scene.loading
    if loading is not None:
        loaded = math.ceil(min(loading.factor / (loading.step or loading.factor), 1e9))
        return (loaded + loading.release_increments) * (loading.cycles or 1)
    bends = _bends(scene, files)
    own = {s.name: s.increments + len(bends.get(s.name, ())) for s in scene.stages}
    return sum(own[passage.stage.name] for passage in scene.passages)


def _bends(scene: tables.SceneFile, files: Mapping[str, MeshFile] | None) -> dict[str, list[float]]:
    """Return for each stage the shares of it at which an amplitude bends, in order."""
    motions = [getattr(body, axis) for body in scene.rigid.values() for axis in _MOTIONS]
    found: dict[str, set[float]] = {}
    amplitudes = [given for load in scene.loads for given in load.amplitudes.values()]
    amplitudes += [table.amplitude or {} for table in (*scene.contacts, *motions)]
    for stage, given in (entry for amplitude in amplitudes for entry in amplitude.items()):
        if not isinstance(given, int | float):
            try:
                course = course_of(given, None, files)
            except ModelError:  # a mistake of the amplitude
                continue
            found.setdefault(stage, set()).update(course[:-1, 0].round(12).tolist())
    return {stage: sorted(shares) for stage, shares in found.items()}


def _place(passages: list[tables.Passage]) -> Any:
    """Return the function that gives the text for a time: the stage and the share of it done."""

    def words(time: float) -> str:
        k = min(max(math.ceil(time - 1e-9) - 1, 0), len(passages) - 1)
        stage, cycle = passages[k]
        return f"{time - k:.4g} of stage {stage.name}" + (f" in cycle {cycle}" if cycle else "")

    return words


def law_of(table: Any) -> Law:
    """Return the law of a material.

    Raises
    ------
    ModelError
        naming the entry, if the hardening rule does not accept it or if the yield condition does
        not allow the rule
    """
    given = table.given()
    return MaterialParameters(**given).material(elastic="yield_stress" not in given)


def friction_of(table: tables.PairTable) -> FrictionLaw:
    """Return the friction law of a contact pair."""
    return FRICTION.made(table.friction_law, table)


def load_of(
    table: Any,
    courses: Mapping[str, Amplitude | None] | None = None,
    files: Mapping[str, MeshFile] | None = None,
) -> Load:
    """Return the load of a table, with its functions of time by name: zero if none are given.

    ``files`` are those beside the scene, None if not at hand.
    """
    kind = LOADS[table.kind]
    taken = {"kind", "body", "amplitude", *table.amplitudes}
    given = {name: getattr(table, name) for name in table.model_fields_set - taken}
    for name, each in table.tabulated.items():
        given[name] = _table_of(f"{name}.file", each, files)
    if courses is None:
        courses = dict.fromkeys(table.amplitudes, Amplitude.constant(0.0))
    for name, course in courses.items():
        if course is not None and (kind.varies or name != "amplitude"):
            given[name] = course
    return kind(**given)


def _table_of(field: str, given: TabulatedTable, files: Mapping[str, MeshFile] | None) -> Tabulated:
    """Return a table of values of a load."""
    if files is None:
        raise ModelError(field, given.file, "is not at hand: read the scene from its file")
    try:
        return files[given.file].table(given.column).times(given.times)
    except ModelError as error:
        allowed = f"{error.allowed}; it has {error.value}"
        raise ModelError(field, given.file, allowed) from None


def default_element(mesh: Mesh, strain: str) -> str:
    """Return the element of a body that names none.

    With large strain it is ``quad4``: ``quad8`` with 2 x 2 points loses its stability at corners.
    """
    quadrilateral = "quad4" if strain == "large" else "quad8"
    return quadrilateral if mesh.t.shape[0] == 4 else "tri6"


def mesh_of_body(table: tables.BodyTable, meshes: Mapping[str, MeshFile] | None) -> Mesh:
    """Return the mesh of a body at its position, with cuts, cracks and boundaries."""
    return _placed_mesh(_given_mesh(table, meshes), table)


def _given_mesh(table: tables.BodyTable, meshes: Mapping[str, MeshFile] | None) -> Mesh:
    """Return the mesh of the shape or of the file of a body."""
    from solver.mesh.elements import known_elements

    if table.mesh is None:
        kind = known_elements(2).get(table.element or "")  # `Body` refuses any other
        return mesh_of(table.shape, kind.cells if kind else "quad")
    if meshes is None:
        raise ModelError("mesh", table.mesh, "is not at hand: read the scene from its file")
    return meshes[table.mesh].mesh(table.part)


def _placed_mesh(mesh: Mesh, table: tables.BodyTable) -> Mesh:
    """Return the mesh moved to the position of its body, with cuts, cracks and boundaries."""
    if any(table.move):
        mesh = mesh.translated(table.move)
    for name, cut in table.cuts.items():
        try:
            mesh = without(mesh, name, cut.x, cut.y)
        except ModelError as error:
            raise ModelError(f"cuts.{error.field}", error.value, error.allowed) from None
    for name, crack in table.cracks.items():
        mesh = opened(mesh, name, crack.start, crack.end)
    own = {
        new: within(mesh, new, each.of, each.x, each.y).boundaries[new]
        for new, each in table.boundaries.items()
    }
    mesh = mesh.with_boundaries(own) if own else mesh
    for new, box in table.regions.items():
        mesh = marked(mesh, new, box.x, box.y)
    return mesh
