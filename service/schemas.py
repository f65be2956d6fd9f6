"""What the answers look like."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Path
from pydantic import BaseModel, ConfigDict, Field

from service.job import StudyState
from studies.definition.sweep import Axes
from studies.errors import form
from studies.kinds import KINDS

ID = form("^[0-9a-f]{32}$", "must be an id, 32 hexadecimal digits, as lists of the service have it")
ContentId = Annotated[str, Path(pattern=ID, description="content id, 32 hexadecimal digits")]


class Window(BaseModel):
    """The part of a list that is requested."""

    model_config = ConfigDict(extra="forbid")

    limit: int = Field(default=100, ge=1, le=1000, description="entries on a page")
    offset: int = Field(default=0, ge=0, le=2**53, description="entries before the page")


class StudyFilter(Window):
    """The studies that are requested."""

    status: StudyState | None = None
    tag: str | None = Field(default=None, description="one of the tags of the study")
    scene: str | None = Field(default=None, description="name of its scene, or id of a posted one")
    name: str | None = Field(default=None, description="its name; several may have it")
    text: str | None = Field(default=None, description="a part of its name or its note")


class RunFilter(Window):
    """The runs that are requested, by any parameter; a number matches only when it is equal."""

    model_config = ConfigDict(extra="allow")

    scene: str | None = Field(default=None, description="name of the scene")
    status: str | None = Field(default=None, description="outcome, such as ``ok``")
    friction: float | None = Field(default=None, allow_inf_nan=False)
    load_ratio: float | None = Field(default=None, allow_inf_nan=False)
    hardening: str | None = None


class PredictQuery(BaseModel):
    """Which number is predicted, and where: beside these, the parameters that the study varies."""

    model_config = ConfigDict(extra="allow")

    of: str = Field(description="a number of the runs")
    by: Literal["cells", "gaussian"] | None = Field(
        default=None, description="in the cells of a refinement, or by a Gaussian process"
    )
    within: float | None = Field(
        default=None, ge=0, allow_inf_nan=False, description="largest error that is enough"
    )


class Prediction(BaseModel):
    """A number between the runs of a study."""

    of: str
    value: float
    error: float = Field(
        description="by ``gaussian`` the standard deviation of the value, by ``cells`` the error "
        "of the cell; 0 by ``run``"
    )
    unit: str
    by: str = Field(description="``cells``, ``gaussian``, or ``run``: that of this place is there")
    at: dict[str, Any] = Field(description="parameters of the place")
    add: dict[str, Any] | None = Field(
        description="the study to submit where the error is more than `within`"
    )


class Selecting(BaseModel):
    """A query of which all entries but those named select a part of the results."""

    model_config = ConfigDict(extra="allow")

    @property
    def selection(self) -> dict[str, str]:
        """The values selected, by dimension or parameter."""
        return {name: str(value) for name, value in (self.model_extra or {}).items() if value != ""}


FARTHEST = 1e9
"""Largest length in a query [mm], and factor of displacements: no picture overflows."""

Millimetres = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Resolution = Annotated[int, Field(ge=50, le=600, description="dots per inch")]
Zoom = Annotated[
    float | None,
    Field(
        gt=0,
        le=FARTHEST,
        description="only what lies within this distance of the contact's centre, or of its edge "
        "where half of the bodies was computed [mm]",
    ),
]
Part = Annotated[
    list[Millimetres] | None,
    Field(
        min_length=4,
        max_length=4,
        description="only x0 <= x <= x1, y0 <= y <= y1 [mm]: "
        "`window=x0&window=x1&window=y0&window=y1`",
    ),
]
Component = Annotated[str | None, Field(description="of a tensor; the first by default")]


class AuditFigure(BaseModel):
    """The largest value of a figure of the audit among the runs of a study."""

    name: str
    words: str
    value: float
    limit: float = Field(description="a run with a larger value fails")
    run: str = Field(description="id of the run that has it")
    at: dict[str, Any] = Field(description="where the run is in the sweep")


class TableFilter(Selecting):
    """The part of the table of a study that is requested."""

    sort: str = Field(default="", description="a column; with a minus, the largest first")
    columns: str = Field(default="", description="names with commas between; all by default")


class NumbersFilter(Selecting):
    """The columns of the table of a study that are requested."""

    name: list[str] = Field(min_length=1, max_length=100, description="names of columns")


class MapQuery(BaseModel):
    """Which field of a run is drawn."""

    model_config = ConfigDict(extra="forbid")

    field: str | None = Field(
        default=None,
        description="variable on the map grid; `residual_stress` by default, or `map_stress` where "
        "the bodies are not released",
    )
    component: Component = None
    stage: str | None = Field(default=None, description="of several stages; the last by default")
    zoom: Zoom = None
    window: Part = None
    deformed: float = Field(
        default=0.0, ge=-FARTHEST, le=FARTHEST,
        description="factor of the displacements, of a run that keeps its fields",
    )  # fmt: skip
    resolution: Resolution = 150


class LineQuery(Selecting):
    """Which lines of a run are drawn."""

    field: str = Field(description="variable along a line, a contact, a depth or the increments")
    component: Component = None
    zoom: Zoom = None
    resolution: Resolution = 150


class PlotQuery(Selecting):
    """Which field of a study is drawn."""

    field: str | None = Field(
        default=None, description="a number of the runs, a map or lines; a map by default"
    )
    component: Component = None
    over: str | None = Field(default=None, description="axis of which each value has lines")
    zoom: Zoom = None
    window: Part = None
    resolution: Resolution = 150


class SketchQuery(Selecting):
    """Which part of a scene is drawn, for which values of its parameters."""

    zoom: Annotated[float | None, Field(gt=0, le=FARTHEST)] = Field(
        default=None, description="only what lies within this distance of the origin [mm]"
    )
    window: Part = None
    resolution: Resolution = 150


class StudySummary(BaseModel):
    """Where a study stands."""

    id: str
    name: str
    scene: str
    status: StudyState
    message: str = Field(
        description="why it failed; while it runs, what it waits for or why it was started again"
    )
    progress: float = Field(ge=0, le=100, description="percentage of the work that is done")
    size: int = Field(
        description="number of runs; the largest possible one if the study chooses them"
    )
    stage: str = Field(description="of a study that chooses its runs, how far it is")
    priority: int = Field(description="the greater is computed first")
    submitted: str
    started: str | None
    finished: str | None


class StudyRun(BaseModel):
    """One run as a part of a study."""

    id: str
    status: str = Field(description="outcome, or ``pending``")
    message: str
    at: dict[str, Any] = Field(description="its values, or labels, on the axes of the sweep")


def _with_kinds(schema: dict[str, Any]) -> None:
    """Add the entries of kinds of study to the JSON Schema of a study."""
    schema["properties"] |= {name: {"type": "object"} for name in KINDS}
    schema["required"] += KINDS


class StudyDetail(StudySummary):
    """A study with its definition and a page of its runs."""

    model_config = ConfigDict(extra="allow", json_schema_extra=_with_kinds)

    scene_name: str = Field(description="name of its scene, also of a posted one; else empty")
    parameters: dict[str, Any]
    sweep: Axes
    note: str = Field(description="what its author wrote of it")
    tags: list[str]
    keep: str = Field(description="``fields`` where the runs keep the fields at the nodes")
    allow: list[str] = Field(
        description="``large_strain`` where runs outside small-strain theory are taken as ok"
    )
    counts: dict[str, int] = Field(description="runs by status, as the study takes them")
    runs: list[StudyRun] = Field(
        description="a page of its runs; if it chooses them, of those that it has asked for"
    )


class Run(BaseModel):
    """One run in the catalogue."""

    id: str
    scene: str
    status: str
    message: str
    parameters: dict[str, Any]
    scalars: dict[str, int | float | None] = Field(description="the figures of the run")
    created: str
    cpu_seconds: float | None
    keep: str = Field(description="``fields`` where its file has the fields at the nodes")


class StudyPage(BaseModel):
    """A part of the list of studies, the latest first."""

    total: int
    items: list[StudySummary]


class RunPage(BaseModel):
    """A part of the list of runs."""

    total: int
    items: list[Run]


class SceneSummary(BaseModel):
    """A scene in the list of scenes."""

    name: str
    summary: str
    branch: str = Field(
        description="the parameter along which one loading path serves many runs; empty: none"
    )
    id: str | None = Field(default=None, description="of a posted scene: a study names it so")


class KeptScene(BaseModel):
    """A scene file that was accepted."""

    id: str = Field(description="content id: a study names the scene so")
    name: str
    summary: str
    note: str = Field(
        default="", description="what the answer shows in place of what was posted, and why"
    )


class Health(BaseModel):
    """Whether studies can be accepted and computed."""

    status: Literal["ready", "waiting", "failing"]
    data_writable: bool | None = Field(default=None, description="for callers with a key")
    queue_readable: bool | None = Field(default=None, description="for callers with a key")
    catalogue_readable: bool | None = Field(default=None, description="for callers with a key")
    executor_alive: bool | None = Field(default=None, description="for callers with a key")
    waiting: dict[str, str] | None = Field(
        default=None, description="running studies that wait, and what for; with a key"
    )
