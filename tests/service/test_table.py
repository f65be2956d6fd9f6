"""Numbers of a study's runs, and values of a run, as they are sent."""

from __future__ import annotations

import asyncio
import csv
import dataclasses
import io
import json
import math
import os
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.errors import NotFound
from service.jobs import Jobs
from service.pages.form import as_toml, study_of
from service.pages.shown import audited, numbers_of
from service.settings import Settings
from service.turns import Share
from studies import Store, open_netcdf, open_study
from studies.definition.identity import content_id
from studies.kinds import KINDS
from studies.views.table import RunTable, column_of
from studies.views.written import FORMS
from tests.counted import counted, growth
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import FAKE

AXES = {"load_ratio": [0.3, 0.9], "friction": [0.0, 0.2, 0.4], "hardening": ["none", "isotropic"]}
FIELDS = {"content-type": "application/x-www-form-urlencoded"}


class Seen:
    """A service whose runner does not work, on a directory with a computed study."""

    def __init__(self, store: Store) -> None:
        study = fake_study(sweep=AXES)
        compute_here(study, store)
        self.dataset = open_study(store.dataset_path(study.id))
        self.run = next(iter(study.run_ids()))
        self.path = store.run_path(self.run)
        self.client = TestClient(
            create_app(Settings(data=store.directory)),
            "http://localhost",
            raise_server_exceptions=False,
        )
        self.id = study.id
        self.study = f"/studies/{study.id}"

    def lines(self, **query: str) -> list[dict[str, str]]:
        """Return the table of the study, a line for each run."""
        answer = self.client.get(f"{self.study}/table.csv", params=query)
        assert answer.status_code == 200, answer.text
        return list(csv.DictReader(io.StringIO(answer.text)))


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    return Seen(Store(tmp_path_factory.mktemp("seen") / "out"))


def arrays(content: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """Return the head and the arrays of octets."""
    line, _, rest = content.partition(b"\n")
    assert (len(line) + 1) % 8 == 0
    head, found = json.loads(line), {}
    for each in head["arrays"]:
        count, kind = math.prod(each["shape"]), np.dtype(each["type"])
        found[each["name"]] = np.frombuffer(rest, kind, count).reshape(each["shape"])
        rest = rest[count * kind.itemsize :]
    assert not rest
    return head, found


def test_the_table_has_every_number_of_the_data_set(seen: Seen) -> None:
    number = seen.dataset["peak_residual_tension"]
    rows = seen.lines()
    assert len(rows) == number.size == 12
    for row in rows:
        at = {name: row[name] for name in ("hardening",)}
        at |= {name: float(row[name]) for name in ("load_ratio", "friction")}
        assert float(row["peak_residual_tension"]) == number.sel(at).item()
        assert row["status"] == "ok"


def test_a_table_is_filtered_and_sorted(seen: Seen) -> None:
    rows = seen.lines(friction="0.1..0.4", hardening="isotropic", sort="-friction")
    assert [float(row["friction"]) for row in rows] == [0.4, 0.4, 0.2, 0.2]
    assert {row["hardening"] for row in rows} == {"isotropic"}
    assert len(seen.lines(friction="0.2,0.4", load_ratio="..0.5")) == 4
    assert not seen.lines(status="error")
    assert len(seen.lines(status="error,ok")) == 12
    (first, *_) = seen.lines(sort="load_ratio", columns="run,load_ratio")
    assert list(first) == ["run", "load_ratio"] and first["load_ratio"] == "0.3"
    (header, *_) = seen.client.get(f"{seen.study}/table.csv?columns=run,run").text.splitlines()
    assert header == "run"


def test_a_table_is_the_same_in_every_form(seen: Seen) -> None:
    asked = {"friction": "0.1..0.4", "sort": "-friction"}
    asked["columns"] = "run,friction,status,peak_residual_tension"
    lines = seen.lines(**asked)
    whole = seen.client.get(f"{seen.study}/table.json", params=asked).json()
    assert [{k: str(v) for k, v in row.items()} for row in whole["rows"]] == lines
    units = {each["name"]: each["unit"] for each in whole["columns"]}
    assert list(units) == list(lines[0]) and units["peak_residual_tension"] == "MPa"
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra `parquet` is not installed")
    answer = seen.client.get(f"{seen.study}/table.parquet", params=asked)
    stored = parquet.read_table(io.BytesIO(answer.content))
    assert stored.to_pylist() == whole["rows"] and len(lines) == 8
    assert stored.schema.field("peak_residual_tension").metadata[b"units"] == b"MPa"


def test_a_service_without_pyarrow_says_so(seen: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.routes.numbers.find_spec", lambda name: None)
    answer = seen.client.get(f"{seen.study}/table.parquet")
    assert answer.status_code == 406
    assert "residua-contact[parquet]" in answer.json()["detail"]


@pytest.mark.parametrize("begun", ["=", "+", "-", "@", "\t", "\r"])
def test_a_spreadsheet_takes_no_text_for_a_formula(begun: str) -> None:
    labels = np.array([f"{begun}1+1", "a=b"], dtype=object)
    columns = [
        column_of("case", labels, "sweep"),
        column_of("x", np.array([-1.5, math.nan]), "result"),
    ]
    text = b"".join(FORMS["csv"].write(columns, np.arange(2))).decode()
    rows = list(csv.reader(io.StringIO(text, newline="")))
    shown = begun.replace("\r", " ")
    assert rows == [["case", "x"], [f"'{shown}1+1", "-1.5"], ["a=b", ""]]
    whole = json.loads(b"".join(FORMS["json"].write(columns, np.arange(2))))
    assert whole["rows"] == [{"case": f"{begun}1+1", "x": -1.5}, {"case": "a=b", "x": None}]


@pytest.mark.parametrize("form", FORMS)
def test_a_table_is_written_in_pieces(form: str) -> None:
    if form == "parquet":
        pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
    columns = [column_of(f"c{k}", np.linspace(0.0, k, 60_000), "result") for k in range(3)]
    sizes = [len(piece) for piece in FORMS[form].write(columns, np.arange(60_000))]
    assert max(sizes) < 0.5 * sum(sizes)


@pytest.mark.parametrize(("condition", "kept"), [("1e-12..", 2), ("..1e-12", 1), ("1e-12", 0)])
def test_a_range_of_small_numbers_has_small_ends(condition: str, kept: int) -> None:
    column = column_of("audit_small", np.array([2e-13, 3e-12, 4e-11, math.nan]), "audit")
    table = RunTable(axes={}, columns={"run": column, "audit_small": column})
    assert len(table.chosen(where={"audit_small": condition})) == kept


@pytest.mark.parametrize(
    ("sweep", "asks"),
    [
        ({"friction": [0.0, 0.4]}, {"refine": {"of": ["peak_residual_tension"]}}),
        ({}, {"fit": {"ranges": {"friction": [0.0, 0.4]}}}),
    ],
)
def test_runs_that_a_study_chooses_have_their_own_places(
    seen: Seen, sweep: dict, asks: dict
) -> None:
    """Such studies come from the command line: more runs than corners, and between them."""
    known = {row["run"]: row["friction"] for row in seen.lines()}
    study = {"name": "own", "scene": "fake", "parameters": {}, "sweep": sweep, **asks}
    study_id = content_id(study)
    seen.client.app.state.jobs.accept(study_id, study, known, most=20, stage="1 of 1")
    lines = seen.client.get(f"/studies/{study_id}/table.csv?friction=0.2..0.4").text
    found = {row["run"]: row["friction"] for row in csv.DictReader(io.StringIO(lines))}
    assert found == {run: at for run, at in known.items() if at != "0.0"}
    detail = seen.client.get(f"/studies/{study_id}").json()
    assert {run["id"]: str(run["at"]["friction"]) for run in detail["runs"]} == known
    assert detail["counts"] == {"ok": 12}
    assert seen.client.get(f"/ui/studies/{study_id}").status_code == 200


def test_numbers_that_stand_for_words_are_filtered_by_words() -> None:
    column = column_of("mode", np.array([0.0, 1.0, math.nan]), "result")
    column = dataclasses.replace(column, flags={0: "rolls", 1: "slides"})
    table = RunTable(axes={}, columns={"run": column, "mode": column})
    assert table.chosen(where={"mode": "slides, nothing"}).tolist() == [1]
    assert table.chosen(where={"mode": "slides,rolls"}).tolist() == [0, 1]


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"friction": "much"}, "friction"),
        ({"sort": "nothing"}, "sort"),
        ({"columns": "run,nothing"}, "columns"),
        ({"nothing": "1"}, "nothing"),
        ({"friction": "1," * 100 + "1"}, "friction"),
    ],
)
def test_a_wrong_query_of_a_table_is_refused(seen: Seen, query: dict[str, str], field: str) -> None:
    answer = seen.client.get(f"{seen.study}/table.csv", params=query)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


def test_numbers_are_sent_without_loss(seen: Seen) -> None:
    asked = {"name": ["peak_residual_tension", "status", "friction"]}
    answer = seen.client.get(f"{seen.study}/numbers", params=asked)
    head, found = arrays(answer.content)
    order = ("load_ratio", "friction", "hardening")
    number = seen.dataset["peak_residual_tension"].transpose(
        *seen.client.get(seen.study).json()["sweep"]
    )
    assert {*order} == {*number.dims}
    assert np.array_equal(found["peak_residual_tension"], number.to_numpy().ravel())
    assert {head["words"]["status"][int(code)] for code in found["status"]} == {"ok"}
    assert {*found["friction"]} == {0.0, 0.2, 0.4}
    assert seen.client.get(f"{seen.study}/numbers", params={"name": "run"}).status_code == 422


def test_only_the_runs_that_meet_conditions_are_sent_and_texts_as_numbers(seen: Seen) -> None:
    asked = {"name": ["friction", "hardening"], "friction": "0.1..0.3", "hardening": "isotropic"}
    answer = seen.client.get(f"{seen.study}/numbers", params=asked)
    head, found = arrays(answer.content)
    lines = seen.lines()
    places = [lines[int(at)] for at in found["at"]]
    met = [each for each in lines if each["friction"] == "0.2" and each["hardening"] == "isotropic"]
    assert places == met and len(met) == 2
    assert [head["words"]["hardening"][int(code)] for code in found["hardening"]] == [
        "isotropic"
    ] * 2
    assert {*found["friction"]} == {0.2}


def test_the_values_of_a_run_are_those_of_its_file(seen: Seen) -> None:
    outline = seen.client.get(f"/runs/{seen.run}/fields").json()
    assert outline["maps"][0]["name"] == "residual_stress"
    asked = {"field": "residual_stress", "component": "yy"}
    answer = seen.client.get(f"/runs/{seen.run}/values", params=asked)
    head, found = arrays(answer.content)
    assert head["unit"] == "MPa" and head["across"]["name"] == "x"
    with open_netcdf(seen.path) as run:
        stored = run["residual_stress"].sel(component="yy").squeeze().to_numpy()
        here = found["x"] >= run["x"].to_numpy()[0] - 1e-6
    assert np.array_equal(
        found["residual_stress"][:, here], stored.astype(np.float32), equal_nan=True
    )
    tag = {"if-none-match": answer.headers["etag"]}
    assert seen.client.get(answer.url, headers=tag).status_code == 304


def test_a_map_less_itself_is_zero(seen: Seen) -> None:
    asked = {"field": "residual_stress", "minus": seen.run}
    answer = seen.client.get(f"/runs/{seen.run}/values", params=asked)
    difference = arrays(answer.content)[1]["residual_stress"]
    assert np.nanmax(np.abs(difference)) == 0.0
    unknown = {"field": "residual_stress", "minus": "0" * 32}
    assert seen.client.get(f"/runs/{seen.run}/values", params=unknown).status_code == 422


def test_pages_have_a_strict_policy_and_their_files_are_kept_for_good(seen: Seen) -> None:
    for address in ("/ui/", "/"):
        answer = seen.client.get(address, follow_redirects=True)
        assert answer.url.path == "/ui"
    policy = dict(
        part.strip().split(" ", 1) for part in answer.headers["content-security-policy"].split(";")
    )
    assert policy["script-src"] == "'self'" and policy["default-src"] == "'none'"
    assert "<script>" not in answer.text and "style=" not in answer.text
    (style,) = [word.split('"')[1] for word in answer.text.split("href=") if "style.css" in word]
    kept = seen.client.get(style)
    assert "immutable" in kept.headers["cache-control"]
    assert kept.headers["content-encoding"] == "gzip"
    plain = seen.client.get(style, headers={"accept-encoding": "identity"})
    assert plain.content == kept.content and "content-encoding" not in plain.headers
    charts = seen.client.get(style.replace("style.css", "plotly.js"))
    assert b"plotly.js v" in charts.content[:200]
    assert seen.client.get(style.replace("style.css", "..%2Froutes.py")).status_code == 404
    assert seen.client.get("/ui/static/other/style.css").status_code == 404, "kept for good"


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("?sort=nothing", 422),
        ("?where.friction=much", 422),
        ("?page=99&sort=-friction&where.status=ok", 200),
        ("?run=nonsense&number=nonsense&page=x", 200),
        ("?page=" + "9" * 5000, 200),
    ],
)
def test_any_address_of_a_study_is_a_page(seen: Seen, query: str, status: int) -> None:
    answer = seen.client.get(f"/ui{seen.study}{query}")
    assert answer.status_code == status
    assert answer.headers["content-type"].startswith("text/html")


@pytest.mark.parametrize(
    "path",
    [
        "/ui/studies/" + "0" * 32,
        "/ui/runs/1",
        "/ui/x",
        "/ui/compare?run=1",
        "/ui/compare?run=" + "z" * 32,
    ],
)
def test_what_is_not_there_is_told_by_a_page(seen: Seen, path: str) -> None:
    answer = seen.client.get(path)
    assert answer.status_code in (404, 422)
    assert "<h1>" in answer.text


def test_a_program_to_copy_has_no_text_of_the_address(seen: Seen) -> None:
    page = seen.client.get(f"/ui{seen.study}", params={"number": "x; import os"}).text
    program = page.split("print(")[1].split("</pre>")[0]
    assert program.startswith("dataset.") and "import" not in program


def test_a_study_that_has_just_been_deleted_leaves_the_list(
    seen: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(self: Jobs, job_id: str) -> dict:
        raise NotFound(f"no study has the id {job_id}")

    monkeypatch.setattr(Jobs, "study", gone)
    answer = seen.client.get("/ui")
    assert answer.status_code == 200 and seen.id in answer.text


@pytest.mark.parametrize("text", ["0 .. 1 in " + "9" * 5000, "." * 60_000, "1," * 60_000])
def test_a_long_text_in_a_field_is_told_soon(text: str) -> None:
    study_of("fake", FAKE, {})  # what is looked up once
    with counted() as calls:
        _, wrong = study_of("fake", FAKE, {"p.friction": [text]})
    assert "friction" in wrong
    assert calls < 1_000, "not in proportion to its length"


def test_the_time_for_a_long_text_does_not_grow_with_its_square() -> None:
    def work(length: int) -> None:
        for _ in range(20):
            study_of("fake", FAKE, {"p.friction": ["." * length]})

    work(1)
    assert growth(work, 1_000) < 8


def test_a_form_tells_that_there_is_no_room(seen: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=10))
    fields = {"scene": "punch", "name": "large", "p.friction": "0.11"}
    for more in ({}, {"submit": "yes"}):
        answer = seen.client.post("/ui/new", data=fields | more)
        assert answer.status_code == 422 and "free on the disk" in answer.text


def test_a_form_tells_all_that_the_scene_refuses_beside_its_fields(seen: Seen) -> None:
    idle = ("saturation", "isotropic_fraction")
    fields = {"scene": "punch", "name": "idle", **{f"p.{name}": "0.3" for name in idle}}
    answer = seen.client.post("/ui/new", data=fields, headers={"accept": "application/json"})
    wrong = answer.json()["wrong"]
    assert {*wrong} == {*idle} and all("changes nothing" in each for each in wrong.values())


def test_a_form_has_a_field_for_each_entry_of_what_chooses_runs(seen: Seen) -> None:
    shown = seen.client.get("/ui/new").text
    for kind, model in KINDS.items():
        described = model.model_json_schema()
        assert described["description"] in shown
        for entry in described["properties"]:
            assert f'name="{kind}.{entry}"' in shown
    assert 'name="sample.num"' in shown and 'name="points"' in shown


GOAL = {"goal.of": "peak_contact_pressure", "goal.at": "2 GPa", "goal.between": "[0.2, 0.9]"}


@pytest.mark.parametrize(
    ("fields", "content"),
    [
        (GOAL, {"of": "peak_contact_pressure", "at": "2 GPa", "between": [0.2, 0.9]}),
        ({"goal.find": "limit_load", "goal.between": "[1, 2]", "goal.within": "0.1"},
         {"find": "limit_load", "between": [1, 2], "within": 0.1}),
        ({"minimise.where": '["a < 2", "b > 1"]', "minimise.ranges": "friction = [0, 0.3]"},
         {"where": ["a < 2", "b > 1"], "ranges": {"friction": [0, 0.3]}}),
        ({"points": "[{friction = 0.1}, {passes = 2}]"}, [{"friction": 0.1}, {"passes": 2}]),
    ],
)  # fmt: skip
def test_fields_of_an_entry_are_values_as_in_a_study_file(fields: Any, content: Any) -> None:
    table = next(iter(fields)).partition(".")[0]
    given = {name: [text] for name, text in (fields | {"choose": table, "fit.most": ""}).items()}
    study, wrong = study_of("punch", FAKE, given)
    assert not wrong and study[table] == content
    assert table not in study_of("punch", FAKE, given | {"choose": [""]})[0]


def test_a_form_computes_a_goal_and_tells_its_mistakes_beside_its_fields(seen: Seen) -> None:
    fields = {"scene": "punch", "name": "sought", "choose": "goal", "p.friction": "0, 0.2", **GOAL}
    accepts = {"accept": "application/json"}
    answer = seen.client.post("/ui/new", data=fields, headers=accepts).json()
    assert answer["wrong"] == {} and answer["estimate"]["runs"].startswith("about ")
    assert "goal = {of = " in answer["toml"]
    fields |= {"goal.between": "[2, 1]", "goal.within": "7", "goal.at": "3 mm"}
    answer = seen.client.post("/ui/new", data=fields, headers=accepts).json()
    assert {*answer["wrong"]} == {"goal.between", "goal.within", "goal.at"}
    page = seen.client.post("/ui/new", data=fields)
    assert page.status_code == 422 and 'value="[2, 1]"' in page.text
    del fields["goal.at"], fields["goal.within"]
    page = seen.client.post("/ui/new", data=fields | {"goal.between": "[1, 2]"})
    assert page.status_code == 422 and "needs of and one of at," in page.text, "of the whole table"


def test_studies_are_found_by_scene_and_text(seen: Seen) -> None:
    assert seen.client.get("/studies", params={"scene": "fake", "text": "FAK"}).json()["total"] == 1
    assert seen.client.get("/studies", params={"scene": "punch"}).json()["total"] == 0
    assert seen.client.get("/studies", params={"text": "nobody"}).json()["total"] == 0
    assert "No study matches" in seen.client.get("/ui", params={"text": "nobody"}).text


def test_a_form_of_another_site_changes_nothing(seen: Seen) -> None:
    address = f"/ui{seen.study}/retry"
    other = FIELDS | {"origin": "http://other.example", "sec-fetch-site": "cross-site"}
    assert seen.client.post(address, headers=other).status_code == 403
    assert seen.client.get(seen.study).json()["status"] == "successful"
    assert seen.client.post("/ui/sign-in", json={"key": "x"}).status_code == 415


def test_a_page_shows_text_of_a_study_as_text(seen: Seen) -> None:
    said = "</script><img src=x onerror=alert(1)>"
    posted = {"name": "said", "scene": "punch", "note": said, "sweep": {"friction": [0.1]}}
    study_id = seen.client.post("/studies", json=posted).json()["id"]
    for path in ("/ui", f"/ui/studies/{study_id}"):
        assert said not in seen.client.get(path).text


@pytest.mark.parametrize(
    ("then", "kept"),
    [
        ("/ui/health", True),
        ("/ui?tag=rail", True),
        ("//other.example/ui/", False),
        ("https://other.example/ui/", False),
        ("/ui/\\other.example", False),
        ("/studies", False),
    ],
)
def test_after_signing_in_a_caller_stays_here(seen: Seen, then: str, kept: bool) -> None:
    page = seen.client.get("/ui/sign-in", params={"then": then}).text
    wanted = then if kept else "/ui"
    assert f'name="then" value="{wanted}"' in page


def test_a_copied_study_file_says_the_same() -> None:
    said = '\x7f\n"\\é'
    study, wrong = study_of("fake", FAKE, {"name": ["a"], "note": [said], "p.friction": ["0, 0.1"]})
    assert not wrong and study["note"] == said
    assert "#" not in as_toml(study, "fake")
    copied = as_toml(study, "posted")  # its name beside an id
    assert 'scene = "fake"  # posted\n' in copied
    assert {"parameters": {}, **tomllib.loads(copied)} == study


def test_a_study_of_one_run_has_a_table_and_a_page(seen: Seen) -> None:
    posted = {"name": "alone", "scene": "punch"}
    study_id = seen.client.post("/studies", json=posted).json()["id"]
    answer = seen.client.get(f"/studies/{study_id}/table.csv")
    (row,) = csv.DictReader(io.StringIO(answer.text))
    assert row["status"] == "pending"
    assert seen.client.get(f"/ui/studies/{study_id}").status_code == 200


def test_a_page_shows_only_limits_that_every_run_has() -> None:
    """Of a wheel that rolls the reactions may be 5e-3: it does not fail by 1e-5."""
    scalars = {"audit_energy": 1e-3, "audit_reactions": 1e-3, "audit_law": 1e-9, "gap": 1.0}
    found = audited(numbers_of([{"scalars": scalars}], None))
    assert [(each["of"].name, each["kept"]) for each in found["limited"]] == [("audit_law", True)]
    assert [each["of"].name for each in found["others"]] == ["audit_energy", "audit_reactions"]


def test_a_limit_of_a_figure_that_a_run_lacks_is_not_kept() -> None:
    (found,) = audited(numbers_of([{"scalars": {"audit_law": None}}], None))["limited"]
    assert (found["kept"], found["share"]) == (False, 0.0)


def test_files_are_read_in_processes_of_their_own(tmp_path: Path) -> None:
    """The netCDF library ends a process in which two threads use it."""

    async def all_at_once() -> list[int]:
        turns = create_app(Settings(data=tmp_path)).state.reading
        calls = (Share(turns, f"caller {k}").read(os.getpid) for k in range(4))
        return await asyncio.gather(*calls)

    found = asyncio.run(all_at_once())
    assert len({*found, os.getpid()}) == 5
