"""Read study files, and the files of points, curves and sections that they name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from solver.errors import ModelError
from studies.definition.rows import read_table
from studies.errors import StudyError
from studies.kinds import KINDS
from studies.materials import read_material
from studies.scenes.formats import FORMATS
from studies.toml import CASE, read_given, toml_of

POINTS = "points"
"""Entry of a study: its points, or the file that has them."""
_MAY_NAME_FILES, _OF_POINTS = ("parameters", POINTS, "sweep"), (".csv", ".txt")
_LONGEST_CHAIN = 20
"""Largest number of study files that extend one another."""


def read_study(
    path: Path | str, measured: Sequence[Path] = (), chain: int = _LONGEST_CHAIN
) -> dict[str, Any]:
    """Return the tables of a study file.

    ``[points] file = "tests.csv"``, or ``points = "tests.csv"``, names a table beside the
    study, and so does an axis of the sweep with an entry ``file``: see `read_table`. A value of
    a parameter that ends in ``.csv`` or ``.txt`` names the points of a curve, one with the
    ending of a mesh file (`FORMATS`) the mesh of a section, and ``steels.toml#40Cr`` a
    material. Entries of kinds of study name files too, see `Kind.with_files`. The study that
    this one ``extends`` may be a file. What is in the files takes their place, so that the
    content of a study needs no other file. The entry ``files`` has the texts of the study, of its
    scene file and of the studies that it extends, in this order; see `texts_with`.

    Parameters
    ----------
    path : of the study
    measured : tables of measured lines, in place of those that a fit names; the place of one on
        other dimensions may be behind its name: ``crater.csv@stage=unloaded,pass=2``
    chain : largest number of studies in files that it extends, one by the other

    Raises
    ------
    StudyError
        for ``file``, when the study cannot be read or is no TOML; for the place that names another
        file which cannot be read; for ``extends``, when files extend one another in a circle; for
        ``files``, if it is given
    """
    text, folder = read_given(path, "file"), Path(path).parent
    tables = toml_of(text, "file", str(path))
    if "files" in tables:
        allowed = "are the texts of the study and of the files that it names: leave it out"
        raise StudyError("files", tables["files"], allowed)
    files = {Path(path).name: text.decode()}
    files = texts_with(files, _scene_file(tables.get("scene"), folder))
    if "bodies" in tables and "scene" not in tables:
        name = Path(path).name
        allowed = f'is a scene file, not a study: a study has the line scene = "{name}"'
        raise StudyError("file", str(path), allowed)
    if POINTS in tables:
        given = tables[POINTS]
        given = {"file": given} if isinstance(given, str) else given
        tables[POINTS] = _with_table(given, POINTS, folder)
    if isinstance(sweep := tables.get("sweep"), dict):
        for name in sweep:
            sweep[name] = _with_table(sweep[name], f"sweep.{name}", folder)
    for name, kind in KINDS.items():
        own = kind.with_files(tables.get(name), folder, measured)
        if own is not None:
            tables[name] = own
    before = tables.get("extends")
    if isinstance(before, str) and before.endswith(".toml"):
        if not chain:
            allowed = f"extends a study that extends it, or more than {_LONGEST_CHAIN}"
            raise StudyError("extends", before, allowed)
        theirs: Any = read_study(folder / before, (), chain - 1)
        tables["extends"] = theirs
        files = texts_with(files, theirs["files"])
        while isinstance(theirs, dict):  # the scenes of all are beside their files
            if str(theirs.get("scene", "")).endswith(".toml"):
                theirs["scene"] = str(Path(before).parent / theirs["scene"])
            theirs = theirs.get("extends")
    for table in _MAY_NAME_FILES:
        if table in tables:
            tables[table] = _with_files(tables[table], table, folder)
    return {**tables, "files": files}


def texts_with(texts: Mapping[str, str], others: Mapping[str, str]) -> dict[str, str]:
    """Return texts by name with others behind them; of two texts of a name both are kept."""
    found = dict(texts)
    for name, text in others.items():
        own, path, k = name, Path(name), 1
        while found.get(own, text) != text:
            own, k = f"{path.stem}-{k + 1}{path.suffix}", k + 1
        found[own] = text
    return found


def _scene_file(scene: Any, folder: Path) -> dict[str, str]:
    """Return the text of the scene file that a study names, by its name, if it can be read."""
    if isinstance(scene, str) and scene.endswith(".toml"):
        with suppress(StudyError, UnicodeDecodeError):  # the scene is refused where it is read
            return {Path(scene).name: read_given(folder / scene, "scene").decode()}
    return {}


def _with_table(axis: Any, field: str, folder: Path) -> Any:
    """Return the rows of a file of points in place of its name."""
    if not isinstance(axis, dict) or not isinstance(axis.get("file"), str):
        return axis
    for key in axis.keys() - {"file"}:
        raise StudyError(f"{field}.{key}", axis[key], "must be in the file, or left out")
    return read_table(folder / axis["file"], f"{field}.file")


def _with_files(value: Any, field: str, folder: Path) -> Any:
    """Return a value with what is in files in place of their names.

    That of a case is none, nor is one of points, which are refused in these tables.
    """
    if isinstance(value, dict):
        return {
            key: each
            if key in (CASE, POINTS) and isinstance(each, str)
            else _with_files(each, f"{field}.{key}", folder)
            for key, each in value.items()
        }
    if isinstance(value, list):
        return [_with_files(each, f"{field}[{k}]", folder) for k, each in enumerate(value)]
    if not isinstance(value, str):
        return value
    if not value.endswith((*_OF_POINTS, *FORMATS)):
        return read_material(value, folder, field)
    try:
        if value.endswith(_OF_POINTS):
            from solver.rolling.rail.profiles.points import read_points  # loads numpy

            return read_points(folder / value).T.tolist()
        from studies.scenes.meshfile import MeshFile  # loads scipy

        return MeshFile(value, read_given(folder / value, field)).section()
    except ModelError as error:
        wrong = f"{error.field} {error.allowed}"
        if value.endswith(_OF_POINTS):
            wrong = f"is read as a curve of points z, y: {wrong}"
        raise StudyError(field, value, wrong) from None
