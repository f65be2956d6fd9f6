"""What is wrong with a scene file is told, all of it at once, each by its entry."""

from __future__ import annotations

import copy
import pickle
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from solver.results.quantities import IN_SPACE, QUANTITIES
from studies import Study
from studies.errors import SceneError, StudyError, one_of
from studies.scenes import building
from studies.scenes.description import Description
from studies.scenes.names import RESERVED
from studies.scenes.refusals import dotted
from studies.scenes.scene import file_scene
from tests.studies.scenes.conftest import blocks, built
from tests.studies.scenes.mistakes import MISTAKES, put


@pytest.fixture(autouse=True, scope="module")
def meshed_once() -> Iterator[None]:
    """Mesh a shape once for all tests: of a thousand scenes, few have one of their own."""
    meshes: dict[str, Any] = {}
    mesh_of = building.mesh_of

    def once(shape: Any, cells: str) -> Any:
        if (key := f"{cells} {shape!r}") not in meshes:
            meshes[key] = mesh_of(shape, cells)
        return meshes[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(building, "mesh_of", once)
        yield


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_is_told_by_its_entry(kind: str) -> None:
    change, field, allowed = MISTAKES[kind]
    tables = blocks()
    change(tables)
    with pytest.raises(SceneError) as caught:
        built(tables)
    found = {each.field: each.allowed for each in caught.value.mistakes}
    assert len(found) <= 2, "one mistake is told as many"
    assert field in found, caught.value
    assert any(words in found[field] for words in allowed.split("|")), found[field]
    assert "blocks.toml" in str(caught.value)


def told(*kinds: str) -> list[str]:
    """Return the entries that are told of a file with mistakes of these kinds."""
    tables = blocks()
    for kind in kinds:
        MISTAKES[kind][0](tables)
    with pytest.raises(SceneError) as caught:
        built(tables)
    each = [(mistake.field, mistake.allowed) for mistake in caught.value.mistakes]
    assert len(each) == len(set(each)), "a mistake is told twice"
    return [field for field, _ in each]


alone = cache(told)


APART = (
    "unknown table", "unknown word", "default out of range", "hardening without its curve",
    "unknown material", "unknown boundary of a support", "text for a number",
    "unknown contact boundary", "no arithmetic", "unknown stage of an amplitude",
    "unknown entry of a motion", "two of one name", "wrong place of a line",
    "map with half of a grading", "output nowhere",
)  # fmt: skip
"""Kinds of mistakes of which none changes what another one changes."""


def test_all_mistakes_are_told_at_once() -> None:
    together = told(*APART)
    assert len(together) >= len(APART)
    assert set(together) == {field for kind in APART for field in alone(kind)}


@pytest.mark.parametrize("kind", APART)
def test_two_mistakes_bring_no_third(kind: str) -> None:
    """Of all pairs a third: each mistake is met with five others."""
    for other in list(MISTAKES)[APART.index(kind) % 3 :: 3]:
        try:
            both = told(kind, other)
        except (KeyError, TypeError, AttributeError):  # the one took away what the other changes
            continue
        assert set(both) <= {*alone(kind), *alone(other)}, other


def test_all_mistakes_of_bodies_are_told_at_once() -> None:
    tables = blocks()
    for kind in ("unknown boundary", "hardening without its curve"):
        MISTAKES[kind][0](tables)
    tables["bodies"]["lower"]["shape"]["x"] = [4, 0]
    with pytest.raises(SceneError, match="3 mistakes") as caught:
        built(tables)
    fields = {each.field for each in caught.value.mistakes}
    assert fields == {"bodies.lower.shape.x", "materials.steel.curve", "loads[0].boundary"}


@pytest.mark.parametrize("kind", ["body left free", "bodies apart", "bodies overlap"])
def test_what_hurts_no_body_hides_nothing_of_them(kind: str) -> None:
    beside = ("default out of range", "wrong place of a line", "unknown stage", "two of one name")
    assert set(told(kind)) < set(told(kind, *beside))


def test_the_scene_itself_has_no_mistake() -> None:
    assert built(blocks()).name == "blocks"


EVERYTHING = tomllib.loads((Path(__file__).parent / "everything.toml").read_text())


def leaves(tree: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of each number and word of a tree."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(value, dict | list):
            yield from leaves(value, (*at, key))
        else:
            yield (*at, key)


def test_a_derived_constant_needs_no_parameter() -> None:
    tables = blocks()
    tables["contacts"][0]["cohesion"] = "$twentieth"
    tables["derived"]["twentieth"] = "1/20"
    built(tables)
    tables["derived"]["twentieth"] = "-1/20"
    with pytest.raises(SceneError, match=r"cohesion = -0\.05: must be at least 0"):
        built(tables)


def wrongs() -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield each place and, in turns, an expression or a table that is wrong there."""
    for number, where in enumerate(leaves(EVERYTHING)):
        words = where[-1] in ("summary", "description", "unit") or where[0] == "advice"
        yield where, {"wrong": 1} if words or number % 2 else "$nothing"  # any text will do there


@pytest.mark.parametrize(("where", "wrong"), list(wrongs()), ids=dotted)
def test_any_wrong_entry_is_told_by_itself_and_alone(where: tuple[Any, ...], wrong: Any) -> None:
    tables = copy.deepcopy(EVERYTHING)
    put(*where, wrong)(tables)
    with pytest.raises(SceneError) as caught:
        file_scene(Description("everything.toml", tables, {}), built=True)
    told = [each.field for each in caught.value.mistakes]
    if where == ("bodies", "bed", "shape", "near", 0, "size"):  # the one that says $element
        told.remove("parameters.element")
    expected = [dotted(where)]
    tabulated = where[0] == "loads" and where[-1] in ("value", "rise", "xx")
    if isinstance(wrong, dict) and (
        tabulated or where[-2:-1] == ("amplitude",)
    ):  # may be a table of values
        expected = [f"{dotted(where)}.file", f"{dotted(where)}.wrong"]
    assert told == expected


@pytest.mark.parametrize(
    "text", ["a = " + "1" * 5000, "a = " + "[" * 5000, "a = 'b"], ids=lambda t: t[:6]
)
def test_what_is_no_toml_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(StudyError, match=r"^scene = '.*': must be valid TOML: .+$"):
        Description.read(path)
    with pytest.raises(StudyError, match=r"^file = '.*': must be valid TOML: .+$"):
        Study.from_toml(path)


def test_a_file_of_another_encoding_says_so_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes('summary = "Stück"\n'.encode("latin-1"))
    for read, field in ((Description.read, "scene"), (Study.from_toml, "file")):
        with pytest.raises(StudyError, match=f"^{field} = '.*': must be saved as UTF-8.* line 1 "):
            read(path)


def test_a_date_is_text_and_a_mark_of_byte_order_is_nothing(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbfsummary = 1979-05-27\n")
    assert Description.read(path).content == {"summary": "1979-05-27"}


def test_of_thousands_of_mistakes_twenty_are_told_in_a_short_text() -> None:
    """Each of them could list thousands of names, so that 110 kB made a text of 402 MB."""
    tables = blocks()
    tables["derived"] = {f"d{k}": f"$q{k}" for k in range(1000)}
    with pytest.raises(SceneError) as caught:
        built(tables)
    error = pickle.loads(pickle.dumps(caught.value))
    assert len(error.mistakes) == 20 and error.count >= 1000
    assert f"and {error.count - 20} more" in str(error)
    assert len(str(error)) < 50_000


def test_of_thousands_of_names_ten_are_told() -> None:
    names = [f"name{k}" for k in range(6500)] + ["x" * 100_000]
    told = one_of("nam3", names)
    assert "name9 and 6491 more; did you mean name3?" in told
    assert len(one_of("y", names[::-1])) < 500
    assert len(str(StudyError("z" * 100_000, "w" * 100_000, "must be " + "v" * 100_000))) < 2500


def test_names_that_the_documentation_lists_as_taken_are_refused() -> None:
    text = (Path(__file__).parents[3] / "docs" / "reference" / "scene-files.md").read_text()
    _, _, listed = text.partition("name of a variable or dimension of a data set:")
    names = {*re.findall(r"`(\w+)`", listed.partition(", nor a longer one")[0])}
    assert {"force", "depth", "s", "stage", "status"} < names < {*QUANTITIES, *IN_SPACE, *RESERVED}
