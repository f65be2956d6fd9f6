"""From tables to a model and its loading; every mistake on the way is kept, none hides another."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from solver.errors import ModelError
from solver.loading.program import Lap, Program, Stage, load_and_release, load_cycles
from solver.mesh import within, without
from solver.model.amplitude import Amplitude
from solver.model.friction import FRICTION
from solver.model.loads import LOADS
from solver.scenes.material_parameters import MaterialParameters
from studies.errors import StudyError, nearest
from studies.scenes import tables
from studies.scenes.meshfile import MeshFile
from studies.scenes.shape_tables import ArcTable, mesh_of

if TYPE_CHECKING:
    from skfem import Mesh

    from solver.materials.law import Law
    from solver.model.body import Body
    from solver.model.friction import FrictionLaw
    from solver.model.loads import Load
    from solver.model.model import ContactPair, Model
    from solver.model.rigid import RigidBody

T = TypeVar("T")
_BESIDE = (
    "name", "summary", "parameters.", "derived.", "stages", "loading", "results.", "outputs.",
    "singular", "allow", "accuracy", "checks", "advice",
)  # fmt: skip
"""Entries of which the bodies and how they are held do not depend."""


@dataclass
class Builder:
    """Makes the parts of a scene.

    Attributes
    ----------
    scene : its tables, for values of its parameters
    meshes : mesh files by the name that bodies give
    mistakes : what was found wrong so far
    absent : tables with something wrong, such as ``bodies.pin``: stand-ins are in their place
    """

    scene: tables.SceneFile
    meshes: Mapping[str, MeshFile] | None
    mistakes: list[StudyError] = field(default_factory=list)
    absent: Collection[str] = ()
    _boundaries: dict[str, list[str]] = field(default_factory=dict, init=False)

    def model(self) -> Model | None:
        """Return the model; None where there are mistakes.

        What is told of one table hides nothing of the others.
        """
        from solver.model.model import Model
        from solver.model.singular import SingularPoint

        t = self.scene
        laws = {
            name: self.tried(f"materials.{name}", partial(law_of, table))
            for name, table in t.materials.items()
        }
        bodies = [self._body(name, body, laws) for name, body in t.bodies.items()]
        rigid = [self._rigid(name, body) for name, body in t.rigid.items()]
        contacts = [self._contact(k, contact) for k, contact in enumerate(t.contacts)]
        for side in t.results.surfaces:
            self._named("results.surfaces", *side.split("."))
        if self._hurt():
            return None
        return self.tried(
            "",
            lambda: Model(
                bodies=tuple(filter(None, bodies)),
                rigid=tuple(filter(None, rigid)),
                contacts=tuple(filter(None, contacts)),
                singular=tuple(SingularPoint(**each.model_dump()) for each in t.singular),
            ),
        )

    def tried(self, where: str, make: Callable[[], T]) -> T | None:
        """Return what is made; None where it fails, which is kept as a mistake of an entry."""
        try:
            return make()
        except ModelError as error:
            name = f"{where}.{error.field}" if where else error.field
            self.mistakes.append(StudyError(name, error.value, error.allowed))
            return None

    def _hurt(self) -> bool:
        """Whether something is wrong that the model is made of."""
        fields = [*self.absent, *(mistake.field for mistake in self.mistakes)]
        return any(not field.startswith(_BESIDE) for field in fields)

    # -- bodies ------------------------------------------------------------------------------

    def _body(
        self, name: str, table: tables.BodyTable, laws: Mapping[str, Law | None]
    ) -> Body | None:
        from solver.model.body import Body

        where = f"bodies.{name}"
        lost = table.mesh is not None and self.meshes is not None and table.mesh not in self.meshes
        if lost or where in self.absent or (table.mesh is None and table.shape is None):
            return None  # that is told already
        at = where if table.shape is None else f"{where}.shape"
        as_made = self.tried(at, lambda: _made(table, self.meshes))
        mesh = self.tried(where, lambda: _placed(as_made, table)) if as_made else None
        if mesh is None:
            return None
        self._boundaries[name] = list(mesh.boundaries or {})
        supports = {
            boundary: held
            for boundary, held in table.supports.items()
            if self._named(f"{where}.supports.{boundary}", name, boundary)
        }
        loads = [
            self._load(k, load)
            for k, load in enumerate(self.scene.loads)
            if load.body == name
            and self._named(f"loads[{k}].boundary", name, getattr(load, "boundary", None))
        ]
        law = laws.get(table.material)
        if law is None:
            return None
        return self.tried(
            where,
            lambda: Body(
                name=name,
                mesh=mesh,
                material=law,
                kinematics=self.scene.kinematics,
                element=table.element or usual_element(mesh),
                thickness=self.scene.thickness,
                supports=supports,
                loads=tuple(filter(None, loads)),
            ),
        )

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
            chain = self.tried(f"rigid.{name}.surfaces.{each}", surface.chain)
            if chain is None:
                return None
            surfaces[each] = RigidSurface(points=chain)
        motions: dict[str, Moved | Pushed] = {}
        for axis in ("x", "y", "rotation"):
            motion: tables.MotionTable = getattr(table, axis)
            amplitude = self._amplitude(f"rigid.{name}.{axis}", motion.amplitude)
            if motion.pushed is not None:
                motions[axis] = Pushed(value=motion.pushed, amplitude=amplitude)
            else:
                motions[axis] = Moved(value=motion.moved or 0.0, amplitude=amplitude)
        return self.tried(
            f"rigid.{name}",
            lambda: RigidBody(
                name=name,
                surfaces=surfaces,
                centre=table.centre,
                thickness=self.scene.thickness,
                **motions,
            ),
        )

    def _named(self, field: str, body: str, boundary: str | None) -> bool:
        """Whether a body has a boundary, or need not have; it is a mistake where it has not."""
        known = self._boundaries.get(body)
        if boundary is None or known is None or boundary in known:
            return True
        allowed = f"must name a boundary of {body}: {', '.join(known) or 'it has none'}"
        self.mistakes.append(StudyError(field, boundary, allowed + nearest(boundary, known)))
        return False

    # -- what acts ---------------------------------------------------------------------------

    def _load(self, k: int, table: tables.LoadTable) -> Load | None:
        where = f"loads[{k}]"
        amplitude = self._amplitude(where, getattr(table, "amplitude", None))
        return self.tried(where, lambda: load_of(table, amplitude))

    def _contact(self, k: int, table: tables.ContactTable) -> ContactPair | None:
        from solver.model.model import ContactPair

        slave, master = (tuple(side.split(".")) for side in (table.slave, table.master))
        for side, (body, boundary) in (("slave", slave), ("master", master)):
            self._named(f"contacts[{k}].{side}", body, boundary)
        amplitude = self._amplitude(f"contacts[{k}]", table.amplitude)
        return self.tried(
            f"contacts[{k}]",
            lambda: ContactPair(
                slave=(slave[0], slave[1]),
                master=(master[0], master[1]),
                friction=friction_of(table),
                sliding=table.sliding,
                gap=table.gap,
                interference=table.interference,
                amplitude=amplitude,
            ),
        )

    def _amplitude(self, where: str, given: tables.Amplitude | None) -> Amplitude | None:
        """Return a load factor over time: time k is the end of the k-th stage."""
        stages = self.scene.stages
        if not stages:
            if given is not None:
                allowed = "needs stages: with loading all loads grow together"
                self.mistakes.append(StudyError(f"{where}.amplitude", given, allowed))
            return None
        values, now = [0.0], 0.0 if given is not None else 1.0
        for stage in stages:
            if given is None:
                values.append(0.0 if stage.release else 1.0)
                continue
            now = given.get(stage.name, 0.0 if stage.release else now)
            values.append(now)
        return Amplitude(np.arange(len(values), dtype=float), np.array(values))

    def program(self) -> Program:
        """Return the loading history."""
        loading = self.scene.loading
        if loading is not None:
            step = loading.step or loading.factor
            if loading.cycles is None:
                return load_and_release(loading.factor, step, loading.release_increments)
            return load_cycles(loading.factor, step, loading.release_increments, loading.cycles)
        stages = tuple(
            Stage(
                name=stage.name,
                target=float(k + 1),
                steps=stage.increments,
                apart=stage.release,
                turns=k > 0,
            )
            for k, stage in enumerate(self.scene.stages)
        )
        return Program(laps=(Lap(stages),), place=_place([stage.name for stage in stages]))


def _place(names: list[str]) -> Any:
    """Return the words for a time: the stage, and how much of it is done."""

    def words(time: float) -> str:
        k = min(max(math.ceil(time - 1e-9) - 1, 0), len(names) - 1)
        return f"{time - k:.4g} of stage {names[k]}"

    return words


def law_of(table: Any) -> Law:
    """Return the law of a material.

    Raises
    ------
    ModelError
        naming the entry, if those of its rule are wrong or do not go with its yield condition
    """
    given = table.given()
    return MaterialParameters(**given).material(elastic="yield_stress" not in given)


def friction_of(table: tables.PairTable) -> FrictionLaw:
    """Return the law of friction of a contact pair."""
    return FRICTION.made(table.friction_law, table)


def load_of(table: Any, amplitude: Amplitude | None = None) -> Load:
    """Return the load of a table."""
    kind = LOADS[table.kind]
    given = table.model_dump(exclude={"kind", "body", "amplitude"}, exclude_unset=True)
    return kind(**given, **{"amplitude": amplitude} if kind.varies else {})


def usual_element(mesh: Mesh) -> str:
    """Return the element of a body that names none."""
    return "quad8" if mesh.t.shape[0] == 4 else "tri6"


def mesh_of_body(table: tables.BodyTable, meshes: Mapping[str, MeshFile] | None) -> Mesh:
    """Return the mesh of a body where it stands, with the boundaries of its table."""
    return _placed(_made(table, meshes), table)


def _made(table: tables.BodyTable, meshes: Mapping[str, MeshFile] | None) -> Mesh:
    """Return the mesh of a body as its shape or its file has it."""
    from solver.mesh.elements import known_elements

    if table.mesh is None:
        kind = known_elements().get(table.element or "")  # the body refuses one that is unknown
        return mesh_of(table.shape, kind.cells if kind else "quad")
    if meshes is None:
        raise ModelError("mesh", table.mesh, "is not at hand: read the scene from its file")
    return meshes[table.mesh].mesh(table.part)


def _placed(mesh: Mesh, table: tables.BodyTable) -> Mesh:
    """Return a mesh where its body stands, with the cuts and the boundaries of its table."""
    if any(table.move):
        mesh = mesh.translated(table.move)
    for name, cut in table.cuts.items():
        try:
            mesh = without(mesh, name, cut.x, cut.y)
        except ModelError as error:
            raise ModelError(f"cuts.{error.field}", error.value, error.allowed) from None
    own = {
        new: within(mesh, new, each.of, each.x, each.y).boundaries[new]
        for new, each in table.boundaries.items()
    }
    return mesh.with_boundaries(own) if own else mesh
