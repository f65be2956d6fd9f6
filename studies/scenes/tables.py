"""The tables of a scene file after its expressions have been evaluated."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Self,
    TypeAlias,
    Union,
    get_args,
    get_origin,
)

import numpy as np
from annotated_types import Interval, Unit
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, StringConstraints, create_model

from solver.errors import ModelError
from solver.loading.program import INCREMENT_ERROR
from solver.mesh.lines import closer
from solver.model.amplitude import Amplitude as OverTime
from solver.model.loads import LOADS, Load
from solver.model.pairs import Components, Springs
from solver.parameters import Accuracy, Coordinate, Length, Needs, Other, Stress
from solver.parts import Declared, declared
from solver.results.outputs import outputs
from solver.results.requested import (
    FORCES_OF_CONTACT,
    OF_CONTACT,
    OF_PART,
    RequestedNumber,
    of_body,
)
from solver.scenes.material_parameters import ContactParameters, MaterialParameters
from studies.errors import StudyError
from studies.materials import parameters_in
from studies.scenes.shape_tables import ArcTable, GradedTable, LineTable, Shape
from studies.scenes.table import (
    Angle,
    Angles,
    Count,
    FieldText,
    FileName,
    Label,
    Place,
    SceneTable,
    Side,
    Span,
    TabulatedTable,
)
from studies.units import COHERENT

# -- bodies ------------------------------------------------------------------------------------


class BoundaryTable(SceneTable):
    """A boundary of the facets of other boundaries whose middles lie in a box."""

    of: Annotated[tuple[str, ...], Field(min_length=1)]
    x: Span | None = None
    y: Span | None = None


class RegionTable(SceneTable):
    """A region of a body: the elements whose middles lie in a box."""

    x: Span | None = None
    y: Span | None = None


class CutTable(SceneTable):
    """A rectangle that is cut out of a body along lines of its mesh: a notch, or a hole.

    The boundary that it opens has its name.
    """

    x: Span
    y: Span


class CrackTable(SceneTable):
    """A crack along lines of the mesh; an end inside the body is a tip. See `solver.mesh.opened`.

    The crack NAME has the boundaries ``NAME_left`` and ``NAME_right``, seen from start to end.
    """

    start: Place
    end: Place


class BodyTable(SceneTable):
    """A body: a shape, or a part of a mesh file."""

    material: str
    shape: Shape | None = None
    mesh: FileName | None = None
    part: str | None = None
    element: str | None = None
    strain: Literal["small", "large"] = "small"
    large_region: str = ""
    move: Place = (0.0, 0.0)
    cuts: dict[Label, CutTable] = Field(default_factory=dict)
    cracks: dict[Label, CrackTable] = Field(default_factory=dict)
    boundaries: dict[Label, BoundaryTable] = Field(default_factory=dict)
    regions: dict[Label, RegionTable] = Field(default_factory=dict)
    supports: dict[str, Literal["x", "y", "xy"]] = Field(default_factory=dict)


_ALL = declared(ContactParameters)
_LAW = [name for name in declared(MaterialParameters) if name != "accuracy"]
OPEN: Mapping[str, Declared] = {
    "materials": {name: _ALL[name] for name in _LAW},
    "contacts": {n: each for n, each in _ALL.items() if n not in (*_LAW, "accuracy")},
}
"""Tables that may be open -> entries that are parameters of the scene if an open one omits them."""


class OpenTable(SceneTable):
    """A table that may be open: entries that it omits are then parameters of the scene."""

    open: bool = False

    def given(self) -> dict[str, Any]:
        """Return the entries that are given."""
        return self.model_dump(exclude={"open"}, exclude_unset=True, exclude_none=True)


NAMED = "named"
"""Entry of a material: the name of another one, for whose parameters it stands."""


def _unknown(material: Any) -> Any:
    """Refuse what names no material: of others the parameters stand in the table."""
    try:
        return parameters_in(material)
    except StudyError as error:
        raise ValueError(error.allowed) from None


def _material() -> type[OpenTable]:
    """Return the table of a material: the parameters of the scenes' materials."""
    known: dict[str, Any] = {n: (hint, f.default) for n, (hint, f) in OPEN["materials"].items()}
    known |= {name: (known[name][0], ...) for name in ("youngs_modulus", "poisson_ratio")}
    known["yield_stress"] = (Stress | None, None)
    known[NAMED] = (Annotated[Any, AfterValidator(_unknown)], None)
    words = "A material; one without a yield stress is elastic."
    return create_model("Material", __base__=OpenTable, __doc__=words, **known)


Material = _material()


# -- rigid bodies --------------------------------------------------------------------------------


class CourseTable(SceneTable):
    """Load factors in a CSV file beside the scene: its columns ``time`` and ``column``."""

    file: FileName
    column: Label = "factor"


Course = Annotated[tuple[tuple[float, float], ...], Field(min_length=1)]
"""Times from the beginning of a stage, up to its end, and load factors; linear between them."""
Amplitude = dict[Label, float | Course | CourseTable]
"""Stage -> load factor at its end, or within it; one left out keeps that of the one before."""


class MotionTable(SceneTable):
    """A motion of a rigid body: prescribed (``moved``), or free under a force (``pushed``).

    From the end of the stage ``locked`` on, a free motion stays as it is then.
    """

    moved: Coordinate | None = None
    pushed: Annotated[float, Unit("N")] | None = None
    amplitude: Amplitude | None = None
    locked: Label | None = None


class RotationTable(MotionTable):
    """A rotation of a rigid body: by an angle (``moved``), or free under a moment (``pushed``)."""

    moved: Angle | None = None
    pushed: Annotated[float, Unit("N mm")] | None = None


class RigidTable(SceneTable):
    """A rigid body: its surfaces by name, its centre and motions."""

    surfaces: dict[
        Label, Annotated[LineTable | GradedTable | ArcTable, Field(discriminator="kind")]
    ] = Field(default_factory=dict)
    centre: Place = (0.0, 0.0)
    x: MotionTable = MotionTable()
    y: MotionTable = MotionTable()
    rotation: RotationTable = RotationTable()


# -- loads and contact ---------------------------------------------------------------------------


class LoadTable(SceneTable):
    """Base of the tables of loads."""

    body: str

    @property
    def tabulated(self) -> dict[str, TabulatedTable]:
        """Its entries that are tables of values."""
        each = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: entry for name, entry in each if isinstance(entry, TabulatedTable)}

    @property
    def amplitudes(self) -> dict[str, Amplitude]:
        """Its entries that are functions of time."""
        each = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: entry for name, entry in each if isinstance(entry, dict)}

    @property
    def plain(self) -> Self:
        """The load with zero in the place of tables of values, which needs no files."""
        return self.model_copy(update=dict.fromkeys(self.tabulated, 0.0))


def _load(word: str, kind: type[Load]) -> type[LoadTable]:
    """Return the table of a kind of load: its parameters."""
    known: dict[str, Any] = {"amplitude": (Amplitude | None, None)} if kind.varies else {}
    known["kind"] = (Literal[word], ...)
    for name, (hint, field) in declared(kind).items():
        kept = _in_file(hint)
        needed = field.default is dataclasses.MISSING
        if hint is OverTime:
            known[name] = (Amplitude, ...) if needed else (Amplitude | None, None)
        elif kept is not None and name != "amplitude":
            known[name] = (kept, ... if needed else field.default)
    return create_model(f"{kind.__name__}Table", __base__=LoadTable, __doc__=kind.__doc__, **known)


def _in_file(hint: Any) -> Any:
    """Return the type of a parameter in a file; None if it is a function of another kind.

    A number that may be a function of position is an expression or a table of values there.
    """
    if get_origin(hint) is Annotated:
        inner, *marks = get_args(hint)
        kept = _in_file(inner)
        return None if kept is None else Annotated[(kept, *marks)]
    if get_origin(hint) not in (Union, UnionType):
        return None if get_origin(hint) is Callable else hint
    kept = tuple(each for each in get_args(hint) if get_origin(each) is not Callable)
    if len(kept) < len(get_args(hint)) and float in kept:
        kept += (TabulatedTable, FieldText)  # a wrong text is told last
    return None if kept == (NoneType,) else Union[kept]  # noqa: UP007


if TYPE_CHECKING:
    AnyLoad = LoadTable
else:
    AnyLoad = Annotated[
        Union[tuple(_load(word, kind) for word, kind in LOADS.all().items())],  # noqa: UP007
        Field(discriminator="kind"),
    ]


class PairTable(OpenTable):
    """Two boundaries that may touch; see `solver.ContactPair`. Its label is ``name``.

    ``active`` are the stages in which the pair is there, by default all. Its forces go to zero in
    the stage after these.
    """

    name: Label
    slave: Side
    master: Side
    sliding: Literal["auto", "small", "finite"] = "auto"
    gap: Coordinate = 0.0
    interference: Coordinate = 0.0
    amplitude: Amplitude | None = None
    active: Annotated[tuple[Label, ...], Field(min_length=1)] | None = None
    friction_law: str


def _contact() -> type[PairTable]:
    """Return the table of a contact pair with the parameters of all friction laws."""
    known: dict[str, Any] = {n: (hint, f.default) for n, (hint, f) in OPEN["contacts"].items()}
    return create_model("ContactTable", __base__=PairTable, **known)


if TYPE_CHECKING:
    ContactTable = PairTable
else:
    ContactTable = _contact()


class LinkTable(SceneTable):
    """A boundary that is tied, kept rigid, or held by springs; see `solver.Link`."""

    slave: Side
    master: Side | None = None
    rigid: str | None = None
    components: Components = "xy"
    stiffness: Springs | None = None
    distributed: bool = False

    @property
    def sides(self) -> tuple[str, ...]:
        """The boundaries that it joins."""
        return (self.slave,) if self.master is None else (self.slave, self.master)


class SingularTable(SceneTable):
    """A point at which strain is unbounded; see `solver.SingularPoint`."""

    at: Place
    radius: Length


class StageTable(SceneTable):
    """A part of the loading, in equal increments.

    Loads without an amplitude reach their full value at the end of the first stage. In a stage with
    ``release`` they go to zero, and the bodies are separated. ``remove`` are regions of bodies,
    ``body.region``, whose elements are removed in it: their stress is released.
    """

    name: Label
    increments: Count = 10
    release: bool = False
    remove: tuple[Side, ...] = ()


class RepeatTable(SceneTable):
    """Stages that follow one another, and how many times they are gone through.

    A state at the end of each is stored of the last time, and of the time before with the name
    ``NAME_before``. With ``until`` they end when the shakedown state is decided, before that many.
    """

    stages: Annotated[tuple[Label, ...], Field(min_length=1)]
    times: Annotated[int, Interval(ge=2, le=1000)]
    until: Literal["shaken_down"] | None = None


class SurfaceCrackTable(SceneTable):
    """A crack straight down from the surface; see `solver.results.surface_crack.SurfaceCrack`."""

    threshold: Annotated[float, Interval(gt=0.0), Unit("MPa mm^0.5")]
    initial: Length
    at: Coordinate | None = None
    across: bool = False


class FatigueTable(SceneTable):
    """A fatigue criterion with its constants, or a crack, in the cycle that runs repeat.

    ``cycle`` names its stages, by default all in their order; a pass over a body without ends is a
    cycle of its own. Without ``residual`` the stress that remains after release is subtracted.
    """

    criterion: str | None = None
    limits: dict[Label, float] = Field(default_factory=dict)
    cycle: tuple[Label, ...] = ()
    residual: bool = True
    bodies: tuple[Label, ...] = ()
    crack: SurfaceCrackTable | None = None


class DerivativesTable(SceneTable):
    """Derivatives of numbers of every run by parameters."""

    by: Annotated[tuple[Label, ...], Field(min_length=1)]
    of: Annotated[tuple[Label, ...], Field(min_length=1)]


class LoadingTable(SceneTable):
    """Loads that grow together to ``factor``, in steps of ``step``, and are then removed.

    Without a step they grow in one increment. ``cycles`` is the number of repetitions.
    """

    factor: Annotated[float, Interval(gt=0.0, le=1e7)]
    step: Annotated[float, Interval(gt=0.0, le=1e7)] | None = None
    release_increments: Count = 5
    cycles: Count | None = None


# -- places of results ---------------------------------------------------------------------------


class SpacedTable(SceneTable):
    """Positions from ``start`` to ``stop``, in equal steps.

    With ``near`` they are ``size`` apart at ``near``, and farther apart away from it. With ``away``
    their distances from ``away``, which lies outside, are in a constant ratio. With ``within`` only
    those between its two positions are kept.
    """

    start: Coordinate
    stop: Coordinate
    num: Annotated[int, Interval(ge=2, le=2000)]
    near: Coordinate | None = None
    size: Length | None = None
    away: Coordinate | None = None
    within: Span | None = None

    def positions(self) -> NDArray[np.float64]:
        """Return the positions (n,) [mm]."""
        points = self._points()
        if self.within is None:
            return points
        return points[(points > self.within[0]) & (points < self.within[1])]

    def _points(self) -> NDArray[np.float64]:
        if self.away is not None:
            if self.near is not None or self.start <= self.away <= self.stop:
                allowed = f"must be < {self.start:g} or > {self.stop:g}, without near"
                raise ModelError("away", self.away, allowed)
            return self.away + np.geomspace(self.start - self.away, self.stop - self.away, self.num)
        if self.near is None or self.size is None:
            return np.linspace(self.start, self.stop, self.num)
        return closer(self.start, self.stop, self.num, self.near, self.size)


Spaced = SpacedTable | Annotated[tuple[Coordinate | SpacedTable, ...], Field(min_length=1)]
"""Positions along an axis: one table, or several tables and single positions in turn."""


def positions(spaced: Spaced) -> NDArray[np.float64]:
    """Return the positions (n,) [mm]."""
    pieces = spaced if isinstance(spaced, tuple) else (spaced,)
    each = [p.positions() if isinstance(p, SpacedTable) else np.array([p]) for p in pieces]
    return np.concatenate(each)


class MapTable(SceneTable):
    """A grid on which stress and strain are stored."""

    x: Spaced
    y: Spaced


class LineResultTable(SceneTable):
    """A straight line or an arc [degrees] in a body."""

    body: str
    start: Place | None = None
    end: Place | None = None
    centre: Place | None = None
    radius: Length | None = None
    angles: Angles | None = None


class PointResultTable(SceneTable):
    """A point of a body."""

    body: str
    at: Place


class ProfileTable(SceneTable):
    """Lines down into a body, at stations along the contact surface."""

    body: str
    depth: Spaced
    stations: Annotated[tuple[Coordinate, ...], Field(min_length=1, max_length=1000)] = (0.0,)


class AxisTable(SceneTable):
    """The line along the contact surfaces; see `solver.results.view.Axis`."""

    origin: Place = (0.0, 0.0)
    along: tuple[float, float] = (1.0, 0.0)


class PlacesTable(SceneTable):
    """Places of results, and the words of outputs.

    ``samples`` is the number of points along lines and contact surfaces. Only the bodies of
    ``surfaces`` have results on the map and along ``s``; without it all bodies have. ``outputs``
    are words of outputs without parameters, by default ``maps`` if there is a map; outputs with
    parameters have their own tables.
    """

    samples: Annotated[int, Interval(ge=2, le=5000)] = 201
    map: MapTable | None = None
    lines: dict[Label, LineResultTable] = Field(default_factory=dict)
    points: dict[Label, PointResultTable] = Field(default_factory=dict)
    s: Spaced | None = None
    surfaces: tuple[Side, ...] = ()
    profile: ProfileTable | None = None
    axis: AxisTable = AxisTable()
    outputs: tuple[str, ...] | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The words of all requested outputs."""
        plain = (("maps",) if self.map else ()) if self.outputs is None else self.outputs
        tables = (w for w, each in outputs().items() if each.parametric and getattr(self, w, None))
        return (*plain, *tables)


def _results() -> type[PlacesTable]:
    """Return the table of results with a table for each output that has parameters."""
    plain = tuple(word for word, each in outputs().items() if not each.parametric)
    known: dict[str, Any] = {"outputs": (tuple[Literal[plain], ...] | None, None)}  # type: ignore[valid-type]
    for word, each in outputs().items():
        if each.parametric:
            known[word] = (_table_of(each.make, _fields(each.make)) | None, None)
    return create_model("ResultsTable", __base__=PlacesTable, **known)


def _table_of(kind: Any, entries: Mapping[str, Any]) -> type[SceneTable]:
    """Return the table of a dataclass with these entries."""
    return create_model(kind.__name__, __base__=SceneTable, __doc__=kind.__doc__, **entries)


def _fields(kind: Any) -> dict[str, Any]:
    """Return the entries of a table from the fields of a dataclass."""
    return {
        name: (hint, ... if field.default is dataclasses.MISSING else field.default)
        for name, (hint, field) in declared(kind).items()
    }


if TYPE_CHECKING:
    ResultsTable = PlacesTable
else:
    ResultsTable = _results()


def _requested() -> type[SceneTable]:
    """Return the table of a requested number of plane bodies; its key is the name."""
    words = (*of_body(2), *OF_CONTACT, *OF_PART, *FORCES_OF_CONTACT)
    known = _fields(RequestedNumber) | {"of": (Literal[words], ...)}
    entries = {name: each for name, each in known.items() if name not in ("name", "z")}
    return _table_of(RequestedNumber, entries)


if TYPE_CHECKING:
    OutputTable: TypeAlias = Any
else:
    OutputTable = _requested()


# -- parameters and the whole file ---------------------------------------------------------------


class OtherThan(SceneTable):
    """Any value of a parameter but this one."""

    other_than: bool | int | float | str


class ParameterTable(SceneTable):
    """A declared parameter: its default, range or choices, unit and meaning.

    `AccuracyTable` sets a parameter without a default. One that ``needs`` others has an effect only
    if one of them has one of the values given.
    """

    default: bool | int | float | str | None = None
    range: tuple[float, float] | None = None
    choices: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    unit: Annotated[str, StringConstraints(max_length=40)] = "1"
    description: Annotated[str, StringConstraints(max_length=400)] = ""
    needs: dict[
        Label, Annotated[tuple[bool | int | float | str, ...], Field(min_length=1)] | OtherThan
    ] = Field(default_factory=dict)

    @classmethod
    def unit_of(cls, name: str, given: Mapping[str, Any]) -> str | None:
        """Return the unit of the default, if it is no word, and of the range."""
        unit = given.get("unit", "1")
        own = name == "range" or (name == "default" and "choices" not in given)
        return unit if own and isinstance(unit, str) else None

    @property
    def needed(self) -> Needs:
        """What it needs, as a Python scene declares it."""
        return {
            name: Other(of.other_than) if isinstance(of, OtherThan) else of
            for name, of in self.needs.items()
        }


class AccuracyTable(SceneTable):
    """Numbers of parameters without a default, for each accuracy."""

    draft: dict[Label, int | float]
    standard: dict[Label, int | float]
    fine: dict[Label, int | float]

    def level(self, accuracy: Accuracy) -> dict[str, int | float]:
        """Return the numbers of an accuracy."""
        found: dict[str, int | float] = getattr(self, accuracy)
        return found


class CheckTable(SceneTable):
    """A condition between parameters: ``that`` must be true, or ``parameter`` is refused."""

    parameter: str
    that: bool
    allowed: Annotated[str, StringConstraints(min_length=1, max_length=400)]


ACCURACY = "accuracy"
"""Name of the parameter that a file with an `AccuracyTable` has."""
_ACCURACY = ParameterTable(
    default="standard",
    choices=get_args(Accuracy),
    description=_ALL[ACCURACY][1].metadata["description"],
)


class AdviceTable(SceneTable):
    """Advice for the user if a run fails, by its status."""

    limit_load: str = "lower the load"
    not_converged: str = ""
    audit_failed: str = "use smaller elements"


class SceneFile(SceneTable):
    """A whole scene file."""

    name: Label
    summary: Annotated[str, StringConstraints(max_length=400)] = ""
    kinematics: Literal["plane_strain", "plane_stress", "axisymmetric"] = "plane_strain"
    thickness: Length = 1.0
    symmetric: bool = False
    parameters: dict[Label, ParameterTable] = Field(default_factory=dict)
    accuracy: AccuracyTable | None = None
    checks: tuple[CheckTable, ...] = ()
    derived: dict[Label, Annotated[Any, Unit(COHERENT)]] = Field(default_factory=dict)
    materials: Annotated[dict[Label, Material], Field(min_length=1)]  # type: ignore[valid-type]
    bodies: Annotated[dict[Label, BodyTable], Field(min_length=1)]
    rigid: dict[Label, RigidTable] = Field(default_factory=dict)
    contacts: tuple[ContactTable, ...] = ()
    links: tuple[LinkTable, ...] = ()
    singular: tuple[SingularTable, ...] = ()
    allow: tuple[Literal["large_strain"], ...] = ()
    increment_error: Annotated[float, Interval(ge=1e-5, le=1.0)] = INCREMENT_ERROR
    loads: tuple[AnyLoad, ...] = ()
    stages: tuple[StageTable, ...] = ()
    repeat: RepeatTable | None = None
    loading: LoadingTable | None = None
    fatigue: FatigueTable | None = None
    derivatives: DerivativesTable | None = None
    results: ResultsTable = ResultsTable()
    outputs: dict[Label, OutputTable] = Field(default_factory=dict)
    advice: AdviceTable = AdviceTable()

    @property
    def declared(self) -> dict[str, ParameterTable]:
        """The parameters, also ``accuracy``; defaults that it sets are those of ``standard``."""
        if self.accuracy is None:
            return self.parameters
        standard = self.accuracy.standard
        return {ACCURACY: _ACCURACY} | {
            name: each.model_copy(update={"default": standard[name]})
            if each.default is None and name in standard
            else each
            for name, each in self.parameters.items()
        }

    @property
    def names(self) -> set[str]:
        """The names of all parameters, also of those that open tables may declare."""
        tables: Mapping[str, Iterable[OpenTable]] = {
            "materials": self.materials.values(),
            "contacts": self.contacts,
        }
        opened = (n for key, each in tables.items() if any(t.open for t in each) for n in OPEN[key])
        return {*self.declared, *opened}

    @property
    def released(self) -> str:
        """Name of the last stage if it releases the bodies, else empty."""
        if self.loading or not self.stages:
            return "unloaded"
        last = self.stages[-1]
        return last.name if last.release and len(self.stages) > 1 else ""

    @property
    def passages(self) -> list[Passage]:
        """The stages in the order in which they are gone through, the repeated ones many times."""
        repeated = self.repeat.stages if self.repeat else ()
        group = [stage for stage in self.stages if stage.name in repeated]
        found: list[Passage] = []
        for stage in self.stages:
            if stage.name not in repeated:
                found.append(Passage(stage))
            elif self.repeat and stage is group[0]:
                for cycle in range(1, self.repeat.times + 1):
                    found += (Passage(each, cycle) for each in group)
        return found

    def end_of(self, stage: str) -> float:
        """Return the time at the end of a stage, the first time that it is gone through."""
        names = [each.stage.name for each in self.passages]
        return names.index(stage) + 1.0 if stage in names else math.inf

    @property
    def stage_names(self) -> list[str]:
        """Names of the states at the ends of stages that are stored."""
        group = list(self.repeat.stages) if self.repeat else []
        found: list[str] = []
        for stage in self.stages:
            if group and stage.name == group[0]:
                found += (f"{name}_before" for name in group)
            found.append(stage.name)
        return found or ["loaded", "unloaded"]


class Passage(NamedTuple):
    """One time that a stage is gone through.

    Attributes
    ----------
    stage : its table
    cycle : number of the time, from 1; 0 for a stage that is not repeated
    """

    stage: StageTable
    cycle: int = 0
