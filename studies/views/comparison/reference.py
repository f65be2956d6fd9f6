"""Published numbers, read from a table: features of profiles below the surface."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from studies.definition.study import Study
from studies.errors import StudyError, one_of

STRAIN = "plastic_strain"

PLACES = (Path(__file__).parents[2] / "data", Path(__file__).parents[3] / "data")
"""Where published numbers are: in an installed package, in a checkout. ``reference/SCENE.csv``
holds the numbers of a scene, ``studies/SCENE-table.toml`` the cases they belong to."""


class Published(BaseModel):
    """A feature of a profile as somebody published it: its value, its depth, or both.

    Attributes
    ----------
    case, pass_number : what was computed
    quantity, component : the feature, and the profile it belongs to
    top, bottom : depths between which the feature lies [mm]
    depth : where it lies [mm]
    value : its value in `unit`; instead of it, `low` or `high` or both where bounds were published
    about : which of value and depth were published as approximate
    against : ``case/pass`` whose value is 100 %; `value` then is the change
    source, note : figure and page; what a reader must know
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    case: str
    pass_number: Annotated[int, Field(ge=1, alias="pass")] = 1
    quantity: Literal["surface", "minimum", "maximum", "local_maximum"]
    component: Literal["xx", "yy", "zz", "xy", "plastic_strain"]
    top: Annotated[float, Field(ge=0.0, alias="from")] = 0.0
    bottom: Annotated[float | None, Field(ge=0.0, alias="to")] = None
    depth: Annotated[float | None, Field(ge=0.0)] = None
    value: float | None = None
    low: float | None = None
    high: float | None = None
    unit: Literal["MPa", "1", "%"]
    about: Literal["value", "depth", "both"] | None = None
    against: Annotated[str, Field(pattern=r"^[^/]+/[1-9][0-9]*$")] | None = None
    source: str
    note: str = ""

    @property
    def key(self) -> tuple[str, int]:
        """Case and pass."""
        return self.case, self.pass_number

    @property
    def reference(self) -> tuple[str, int] | None:
        """Case and pass whose value is 100 %, where the value is a change."""
        if self.against is None:
            return None
        case, _, number = self.against.partition("/")
        return case, int(number)

    @property
    def has_value(self) -> bool:
        """Whether a value or a bound was published."""
        return self.value_bounds != (-math.inf, math.inf)

    @property
    def has_depth(self) -> bool:
        """Whether a depth was published."""
        return self.depth is not None

    @property
    def value_bounds(self) -> tuple[float, float]:
        """Bounds of the value, equal where a number was published; infinite where none was."""
        low = self.low if self.value is None else self.value
        high = self.high if self.value is None else self.value
        return -math.inf if low is None else low, math.inf if high is None else high

    @property
    def depth_bounds(self) -> tuple[float, float]:
        """Bounds of the depth, which is always one number; infinite where none was published."""
        return (-math.inf, math.inf) if self.depth is None else (self.depth, self.depth)


def reference_of(scene: str) -> Path:
    """Return the table of published numbers of a scene.

    Raises
    ------
    StudyError
        when there is none
    """
    found = _kept(f"reference/{scene}.csv")
    if found is None:
        allowed = f"must name a table: Residua has no published numbers of the scene {scene}"
        raise StudyError("--reference", None, allowed)
    return found


def published_cases(scene: str) -> dict[str, Mapping[str, Any]]:
    """Return the parameters of the cases that `reference_of` has numbers of, by label."""
    found = _kept(f"studies/{scene}-table.toml")
    if found is None:
        return {}
    study = Study.from_toml(found)
    return {study.place(case)["case"]: case.values for case in study.cases()}


def _kept(name: str) -> Path | None:
    """Return where a file of published numbers is, or None."""
    return next((place / name for place in PLACES if (place / name).is_file()), None)


def read_reference(path: Path) -> tuple[Published, ...]:
    """Read published numbers.

    Raises
    ------
    StudyError
        when the file cannot be read, or naming the line and column that is wrong
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise StudyError("reference", str(path), f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise StudyError("reference", str(path), "must be a table in UTF-8") from None
    reader = csv.DictReader(io.StringIO(text), restkey="beyond the last column", strict=True)
    try:
        if reader.fieldnames is not None:
            _check_heading(reader.fieldnames, f"{path.name}:1")
        rows = tuple(_published(row, f"{path.name}:{reader.line_num}") for row in reader)
    except csv.Error as error:
        raise StudyError("reference", str(path), f"must be comma-separated: {error}") from None
    if not rows:
        raise StudyError("reference", str(path), "must hold a heading and published numbers")
    return rows


def _check_heading(columns: Sequence[str], line: str) -> None:
    """Refuse a heading that names a column nobody knows, or none that every row needs."""
    fields = {field.alias or name: field for name, field in Published.model_fields.items()}
    for position, column in enumerate(columns):
        if column not in fields:
            raise StudyError(f"{line}: column", column, one_of(column, fields))
        if column in columns[:position]:
            raise StudyError(f"{line}: column", column, "occurs twice: keep one")
    needed = [name for name, field in fields.items() if field.is_required()]
    if missing := [name for name in needed if name not in columns]:
        allowed = f"must name {', '.join(missing)} too"
        raise StudyError(f"{line}: heading", ",".join(columns), allowed)


def _published(row: dict[str, Any], line: str) -> Published:
    given = {name: cell for name, cell in row.items() if cell not in ("", None)}
    try:
        published = Published.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0])
        raise StudyError(f"{line}: {name}", row.get(name), _allowed(first["msg"])) from None
    for name, allowed in _contradictions(published):
        raise StudyError(f"{line}: {name}", row.get(name), allowed)
    return published


def _contradictions(published: Published) -> list[tuple[str, str]]:
    """Return what no single column shows: the column to blame, and what it must be."""
    low, high, bottom = published.low, published.high, published.bottom
    stress = "1" if published.component == STRAIN else "MPa"
    unit = "%" if published.against else stress
    checks = [
        ("unit", f"must be {unit} here", published.unit == unit),
        ("value", "must be empty where low or high is given",
         published.value is None or (low, high) == (None, None)),
        ("value", "must be given, or low, high or depth",
         published.has_value or published.has_depth),
        ("high", "must be larger than low", low is None or high is None or low < high),
        ("to", "must be larger than from", bottom is None or published.top < bottom),
        ("depth", "must be empty at the surface",
         published.quantity != "surface" or not published.has_depth),
    ]  # fmt: skip
    return [(name, allowed) for name, allowed, holds in checks if not holds]


def _allowed(message: str) -> str:
    """Return pydantic's words in ours."""
    told = {
        "Field required": "must be given",
        "Extra inputs are not permitted": "is no column of published numbers",
    }
    for subject in ("Input should", "String should"):
        message = message.replace(subject, "must")
    return told.get(message, message)
