"""What makes another id of a run; comments, docstrings and layout do not."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import solver
import studies.definition.identity
from studies.definition import identity as module
from studies.definition.identity import digests_of, meaning

LAW = '''"""Return mapping."""

from solver.errors import ModelError, NotConverged
from solver.parameters import described

STEPS = 4
OUTPUTS = {"stress": {"long_name": "residual stress", "units": "MPa"}}
WORK = declare("plastic_work", "plastic work", "N mm")
SCENE = Scene(name="punch", summary="a punch on a half-plane", advice={"limit": "less load"})


@dataclass
class Law:
    """A law."""

    E: float = described(2.0e5, "Young's modulus")
    nu: float = described(0.3, "ratio, of " f"{STEPS} steps")

    def stress(self, strain):
        """Return the stress [MPa]."""
        assert strain.ndim == 1, "strain has one axis"
        if strain.max() > 1.0:
            raise ModelError("strain", strain, "must be small" + self.advice())
        # Hooke's law
        return self.E * strain


def ended(load):
    return NotConverged(f"no equilibrium at {load}: " + ("cut" if load else "stop"), load)
'''


def changed(old: str, new: str) -> bool:
    assert LAW.count(old) == 1, old
    return meaning(LAW.replace(old, new)) != meaning(LAW)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("# Hooke's law", "# the linear law\n"),
        ('"""Return mapping."""', '"""Return of the stress to the yield surface."""'),
        ('    """A law."""\n\n', ""),
        ("Return the stress [MPa].", "Return the Cauchy stress [MPa]."),
        ("2.0e5", "200000.0"),
        ("return self.E * strain", "return (\n            self.E * strain\n        )"),
        ('{"stress": {"long_name"', "{'stress': {'long_name'"),
    ],
)
def test_comments_docstrings_and_layout_change_nothing(old: str, new: str) -> None:
    assert not changed(old, new)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("2.0e5", "2.1e5"),
        ("2.0e5", "200000"),
        ("0.3", "-0.3"),
        ("STEPS = 4", "STEPS = 5"),
        ("self.E * strain", "self.E / strain"),
        ("self.E * strain", "strain * self.E"),
        ("strain.max() > 1.0", "strain.max() >= 1.0"),
        ('"stress"', '"residual_stress"'),
        ('"units": "MPa"', '"units": "GPa"'),
        ('"N mm"', '"N"'),
        ('name="punch"', 'name="press"'),
        ("nu: float", "poisson: float"),
        ("nu: float", "nu: int"),
        ("self.advice()", "self.words()"),
        ('"), load)', '"), 0.0)'),
        ("@dataclass\n", ""),
        ("import ModelError, NotConverged", "import NotConverged, ModelError"),
    ],
)
def test_what_may_change_a_number_or_a_name_is_seen(old: str, new: str) -> None:
    assert changed(old, new)


def test_a_text_is_kept() -> None:
    assert meaning("rule = 'none'") != meaning("rule = 'mixed'")
    assert meaning("f(x, 'none')") != meaning("f(x, 'mixed')")


@pytest.mark.parametrize("damage", [b"", b"[]", b'{"maker": "another", "digests": {}}', None])
def test_a_source_is_parsed_once_and_a_damaged_file_of_digests_is_made_again(
    damage: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, parsed = tmp_path / "kept" / "meaning.pyc", []
    monkeypatch.setattr(module, "cache_from_source", lambda file: str(kept))
    monkeypatch.setattr(module, "meaning", lambda source: parsed.append(source) or meaning(source))
    sources = [LAW.encode(), f"# the same\n{LAW}".encode(), b"x = 1"]
    found = digests_of(sources)
    assert found[0] == found[1] != found[2]
    if damage is not None:
        kept.with_suffix(".json").write_bytes(damage)
    assert digests_of(sources) == found
    assert len(parsed) == len(sources) * (1 if damage is None else 2)
    assert digests_of([b"x = 2"]) != found[2:]


def test_digests_are_found_where_they_cannot_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    before = digests_of([LAW.encode()])
    monkeypatch.setattr(module, "cache_from_source", lambda file: str(tmp_path / "file" / "x.pyc"))
    assert digests_of([LAW.encode()]) == before


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of solver and studies, whose digest is taken in place of the real ones'."""
    root = Path(solver.__file__).parents[1]
    for package in ("solver", "studies"):
        shutil.copytree(root / package, tmp_path / package, ignore=shutil.ignore_patterns("*.pyc"))
    (tmp_path / "solver" / "law.py").write_text(LAW)
    monkeypatch.setattr("solver.__file__", str(tmp_path / "solver" / "__init__.py"))
    here = tmp_path / "studies" / "definition" / "identity.py"
    monkeypatch.setattr("studies.definition.identity.__file__", str(here))
    return tmp_path


def digest() -> str:
    return studies.definition.identity.solver_hash.__wrapped__()


def mend(path: Path, change: Callable[[str], str]) -> None:
    text = path.read_text()
    assert change(text) != text
    path.write_text(change(text))


def test_mending_comments_and_docstrings_in_every_file_keeps_the_digest(copied: Path) -> None:
    before = digest()
    for path in copied.rglob("*.py"):
        mend(path, lambda text: f"# mended\n\n{text}\n# the end\n")
    law = copied / "solver" / "law.py"
    mend(law, lambda text: text.replace("A law.", "A law of elasticity."))
    assert digest() == before


def test_the_digest_covers_formulas_defaults_and_the_place_of_a_file(copied: Path) -> None:
    seen = [digest()]
    law = copied / "solver" / "law.py"
    mend(law, lambda text: text.replace("described(0.3,", "described(0.29,"))
    seen.append(digest())
    mend(law, lambda text: text.replace("self.E * strain", "2 * self.E * strain"))
    seen.append(digest())
    law.rename(copied / "solver" / "materials" / "law.py")
    seen.append(digest())
    (copied / "solver" / "new.py").write_text("")
    seen.append(digest())
    assert len(set(seen)) == len(seen)


@pytest.mark.parametrize("name", studies.definition.identity.FORM)
def test_the_digest_covers_what_gives_a_file_its_form(name: str, copied: Path) -> None:
    before = digest()
    mend(copied / "studies" / name, lambda text: f"{text}\nchanged = True\n")
    assert digest() != before


def test_the_digest_leaves_out_what_only_looks_at_results(copied: Path) -> None:
    before = digest()
    mend(copied / "studies" / "views" / "tables.py", lambda text: f"{text}\nchanged = True\n")
    assert digest() == before


def test_an_id_follows_the_digest(monkeypatch: pytest.MonkeyPatch) -> None:
    before = studies.definition.identity.content_id("run", 1)
    monkeypatch.setattr(studies.definition.identity, "solver_hash", lambda: "0" * 32)
    assert studies.definition.identity.content_id("run", 1) != before
