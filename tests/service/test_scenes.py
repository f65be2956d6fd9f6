"""Scene files over HTTP: posted, looked at, swept; what is wrong is told, and nothing is run."""

from __future__ import annotations

import io
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import xarray as xr

from service.turns import BYTES
from studies import Store, Study, run_study
from studies.scenes.scene import read_scene
from studies.storage.ran import MEANINGS
from studies.views.summary import summary_of
from tests.service.servers import Server
from tests.studies.scenes.conftest import BLOCKS
from tests.studies.scenes.test_formats import FORMS, ring

pytestmark = pytest.mark.usefixtures("one_worker")

SCENES = Path(__file__).parents[2] / "data/scenes"
PIN, MESH = (SCENES / "pin.toml").read_bytes(), (SCENES / "pin.msh").read_bytes()
ALLOWED = f"must be read with {BYTES / 2**30:.3g} GiB of memory"
RING = """
name = "ring"
summary = "a part of a ring"
[parameters.push]
default = 1.0
range = [0.1, 9.0]
description = "pressure"
[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
[bodies.ring]
material = "steel"
mesh = "FILE"
part = "PART"
supports = { low = "xy" }
[bodies.ring.boundaries]
low = { of = ["outline"], y = [-0.1, 0.0] }
inside = { of = ["outline"], x = [0.0, 0.98], y = [0.01, 0.3] }
[[loads]]
body = "ring"
kind = "pressure"
boundary = "inside"
value = "$push"
[[stages]]
name = "pressed"
increments = 1
[results]
"""
SWEEP = {"clearance": [0.01, 0.02], "friction": [0.0]}


def post(service: Server, scene: bytes, **meshes: bytes) -> Any:
    files = [("scene", ("scene.toml", scene))]
    files += [("meshes", (name.replace("_", "."), data)) for name, data in meshes.items()]
    return service.client.post("/scenes", files=files)


@pytest.fixture(scope="module")
def pin(service: Server) -> str:
    """The id of the pin, posted."""
    answer = post(service, PIN, pin_msh=MESH)
    assert answer.status_code in (200, 201), answer.text
    assert answer.headers["location"] == f"/scenes/{answer.json()['id']}"
    return str(answer.json()["id"])


def test_a_scene_has_the_id_of_its_content(service: Server, pin: str) -> None:
    assert pin == read_scene(SCENES / "pin.toml").id
    again = post(service, PIN + b"\n# the same\n", pin_msh=MESH)
    assert (again.status_code, again.json()["id"]) == (200, pin)
    assert again.json()["name"] == "pin"


def test_a_table_of_values_is_posted_with_its_scene(service: Server) -> None:
    strip, table = ((SCENES / f"peened.{end}").read_bytes() for end in ("toml", "csv"))
    answer = post(service, strip, peened_csv=table)
    assert answer.status_code == 201, answer.text
    assert answer.json()["id"] == read_scene(SCENES / "peened.toml").id
    other = post(service, strip, peened_csv=table + b"1.5,0\n").json()["id"]
    assert other != answer.json()["id"]
    wrong = post(service, strip, peened_csv=b"z,xx\n0,1\n").json()["errors"]
    assert [each["field"] for each in wrong] == ["loads[0].xx.file"]


@pytest.mark.parametrize("form", ["inp", "med", "exodus", "vtu"])
def test_mesh_files_of_other_formats_are_posted(service: Server, tmp_path: Path, form: str) -> None:
    """A service reads every format that the command reads, and draws its mesh."""
    name, write, kind, (core, *_) = FORMS[form]
    write(ring(kind), tmp_path / name)
    scene = RING.replace("FILE", name).replace("PART", core)
    (tmp_path / "scene.toml").write_text(scene)
    mesh = (tmp_path / name).read_bytes()
    answer = post(service, scene.encode(), **{name.replace(".", "_"): mesh})
    assert answer.status_code == 201, answer.text
    assert answer.json()["id"] == read_scene(tmp_path / "scene.toml").id
    drawn = service.client.get(f"/scenes/{answer.json()['id']}/draw.png")
    assert drawn.headers["content-type"] == "image/png", drawn.text


def test_a_browser_posts_a_scene_and_gets_the_form_of_its_studies(
    service: Server, pin: str
) -> None:
    meshes = {"meshes": ("pin.msh", MESH)}
    answer = service.client.post("/ui/scenes", files={"scene": ("pin.toml", PIN)} | meshes)
    assert answer.status_code == 303
    assert answer.headers["location"] == f"/ui/new?scene={pin}"
    wrong = PIN.replace(b"move =", b"mvoe =").replace(b"supports =", b"sports =")
    answer = service.client.post("/ui/scenes", files={"scene": ("pin.toml", wrong)} | meshes)
    assert answer.status_code == 422
    _, _, told = answer.text.partition("pin.toml is not taken:")
    assert told.count("<li>") > 1 and "mvoe" in told, "each mistake is told"
    assert 'action="/ui/scenes"' in answer.text, "another file can be posted at once"
    form = service.client.get(f"/ui/new?scene={pin}").text
    assert "p.clearance" in form and "more parameters" not in form
    assert "more parameters" in service.client.get("/ui/new?scene=punch").text


def test_the_form_of_a_study_has_a_picture_of_its_scene(service: Server, pin: str) -> None:
    asked = {"scene": pin, "p.clearance": "0.1, 0.15"}
    answer = service.client.get("/ui/scene.png", params=asked)
    assert answer.headers["content-type"] == "image/png", answer.text
    first = service.client.get(f"/scenes/{pin}/draw.png", params={"clearance": 0.1})
    assert answer.content == first.content, "that of the first run"
    wrong = service.client.get("/ui/scene.png", params=asked | {"p.clearance": "-1"})
    assert (wrong.status_code, "clearance" in wrong.text) == (422, True)
    without = service.client.get("/ui/scene.png", params={"scene": "fake"})
    assert (without.status_code, without.content) == (204, b"")


def test_the_first_words_of_a_scene_stay_and_the_answer_says_so(service: Server, pin: str) -> None:
    first = post(service, PIN, pin_msh=MESH).json()
    assert first["note"] == ""
    other = PIN.replace(first["summary"].encode(), b"other words")
    assert other != PIN
    again = post(service, other, pin_msh=MESH)
    assert (again.status_code, again.json()["id"]) == (200, pin)
    assert again.json()["summary"] == first["summary"]
    assert "stay as they were first posted" in again.json()["note"]
    assert service.client.get(f"/scenes/{pin}").json()["summary"] == first["summary"]


def test_a_form_with_two_scenes_is_refused(service: Server) -> None:
    files = [("scene", ("a.toml", PIN)), ("scene", ("b.toml", PIN)), ("meshes", ("pin.msh", MESH))]
    answer = service.client.post("/scenes", files=files)
    assert answer.status_code == 422
    assert answer.json()["detail"] == "scene: must be one file: post each by itself"


def test_a_study_names_a_posted_scene_by_its_name_if_no_other_has_it(service: Server) -> None:
    first = BLOCKS.replace('name = "blocks"', 'name = "dovetail"').encode()
    assert b"dovetail" in first
    study = {"name": "by-name", "scene": "dovetail", "sweep": {"mu": [0.1]}}
    unknown = service.client.post("/estimate", json=study)
    assert unknown.status_code == 422 and "must be one of punch" in unknown.text
    one = post(service, first).json()["id"]
    named = service.client.post("/studies", json=study)
    assert named.status_code == 201, named.text
    same = service.client.post("/studies", json=study | {"scene": one})
    assert (same.status_code, same.json()["id"]) == (200, named.json()["id"])
    told = service.study(same.json()["id"])
    assert (told["scene"], told["scene_name"]) == (one, "dovetail")
    assert f'>dovetail <span class="sub">{one[:8]}…' in service.client.get("/ui").text
    assert str(summary_of(told, None, [])).startswith(f"by-name: scene dovetail ({one[:8]}…)")
    for address in ("/scenes/{}", "/scenes/{}/draw.png", "/ui/new?scene={}"):
        by_name, by_id = (service.client.get(address.format(each)) for each in ("dovetail", one))
        assert by_name.status_code == 200, by_name.text
        assert by_name.content == by_id.content
    other = post(service, first.replace(b"value = 150.0", b"value = 151.0")).json()["id"]
    assert service.client.get("/scenes/dovetail").status_code == 422
    refused = service.client.post("/estimate", json=study)
    assert refused.status_code == 422
    (mistake,) = refused.json()["errors"]
    assert (mistake["field"], mistake["value"]) == ("scene", "dovetail")
    assert "is the name of 2 posted scenes" in mistake["allowed"]
    assert one in mistake["allowed"] and other in mistake["allowed"]


def test_a_scene_is_drawn_before_anything_is_computed(service: Server, pin: str) -> None:
    sizes = {}
    for asked in ({}, {"clearance": 0.1}, {"window": [0, 20, -20, 0]}):
        answer = service.client.get(f"/scenes/{pin}/draw.png", params={"resolution": 50} | asked)
        assert answer.status_code == 200, answer.text
        sizes[str(asked)] = answer.content
    assert all(each.startswith(b"\x89PNG") for each in sizes.values())
    assert len(set(sizes.values())) == 3
    for asked, field, allowed in (
        ({"clarence": 1}, "clarence", "did you mean clearance"),
        ({"clearance": 9}, "clearance", "<= 0.2 [mm]"),
        ({"clearance": "wide"}, "clearance", "must be a finite number"),
        ({"window": [5, 4, 0, 1]}, "window", "must be x0 x1 y0 y1"),
        ({"zoom": -1}, "zoom", "greater than 0"),
        ({"zoom": 5e-324}, "zoom", "must be a length [mm] above"),
        ({"window": [0, 5e-324, -1, 0]}, "window", "must be x0 x1 y0 y1"),
        ({"zoom": 1.7e308}, "zoom", "at most 1e+09"),
        ({"zoom": "nan"}, "zoom", ""),
    ):
        answer = service.client.get(f"/scenes/{pin}/draw.png", params=asked)
        assert answer.status_code == 422, asked
        (mistake,) = answer.json()["errors"]
        assert mistake["field"] == field and allowed in mistake["allowed"]
    assert service.client.get(f"/scenes/{'0' * 32}/draw.png").status_code == 404


def test_a_posted_scene_is_listed_and_described(service: Server, pin: str) -> None:
    listed = {each["id"]: each for each in service.client.get("/scenes").json()}
    assert listed[pin]["name"] == "pin"
    assert listed[pin]["branch"] == "load_ratio"
    schema = service.client.get(f"/scenes/{pin}").json()
    assert (schema["id"], schema["name"]) == (pin, "pin")
    known = schema["properties"]["clearance"]
    assert (known["unit"], known["minimum"], known["maximum"]) == ("mm", 1e-4, 0.2)
    assert service.client.get(f"/scenes/{'0' * 32}").status_code == 404


def test_a_study_of_a_posted_scene_has_the_ids_and_numbers_of_the_file(
    service: Server, pin: str, tmp_path: Path
) -> None:
    done = service.finished(service.post({"name": "pins", "scene": pin, "sweep": SWEEP}))
    assert (done["status"], done["counts"]) == ("successful", {"ok": 2})
    study = Study.from_dict({"name": "pins", "sweep": SWEEP}, scene=read_scene(SCENES / "pin.toml"))
    assert done["id"] == study.id
    assert [run["id"] for run in done["runs"]] == list(study.run_ids())
    outcome = run_study(study, Store(tmp_path), workers=1)
    content = service.client.get(f"/studies/{study.id}/dataset.nc").content
    ours = xr.load_dataset(outcome.dataset, engine="h5netcdf")
    theirs = xr.load_dataset(io.BytesIO(content), engine="h5netcdf")
    for name in set(ours.data_vars) - {"cpu_seconds", *MEANINGS}:
        np.testing.assert_array_equal(ours[name], theirs[name], err_msg=str(name))
    found = service.client.get("/runs", params={"scene": "pin", "clearance": 0.02}).json()
    assert [run["id"] for run in found["items"]] == [done["runs"][1]["id"]]
    run = f"/runs/{done['runs'][0]['id']}"
    picture = service.client.get(f"{run}/map.png")
    assert picture.status_code == 200, picture.text
    asked = {"field": "line_stress", "component": "yy", "line": "below", "resolution": 60}
    answer = service.client.get(f"{run}/line.png", params=asked)
    assert answer.content.startswith(b"\x89PNG"), answer.text
    tag = {"if-none-match": answer.headers["etag"]}
    assert service.client.get(f"{run}/line.png", params=asked, headers=tag).status_code == 304
    for wrong in ({"field": "residual_stress"}, asked | {"lyne": "below"}, asked | {"line": "no"}):
        assert service.client.get(f"{run}/line.png", params=wrong).status_code == 422

    page = service.client.get(f"/ui/runs/{done['runs'][0]['id']}").text
    assert "yield stress of the plate" in page


def test_a_run_that_keeps_its_fields_is_sent_for_paraview(
    service: Server, pin: str, tmp_path: Path
) -> None:
    study = {"name": "kept", "scene": pin, "keep": "fields", "sweep": {"clearance": [0.05]}}
    (run,) = service.finished(service.post(study))["runs"]
    assert service.client.get(f"/runs/{run['id']}").json()["keep"] == "fields"
    stages = {}
    for stage in ("loaded", "unloaded"):
        answer = service.client.get(f"/runs/{run['id']}.vtu", params={"stage": stage})
        assert answer.status_code == 200, answer.text
        (tmp_path / "run.vtu").write_bytes(answer.content)
        stages[stage] = meshio.read(tmp_path / "run.vtu")
    assert stages["loaded"].point_data["stress_yy"].min() < -100.0
    assert abs(stages["unloaded"].point_data["stress_yy"]).max() < 1.0  # all was elastic
    last = service.client.get(f"/runs/{run['id']}.vtu").content
    assert last == answer.content
    refused = service.client.get(f"/runs/{run['id']}.vtu", params={"stage": "later"})
    assert refused.status_code == 422
    assert "must be one of loaded, unloaded" in refused.text


def test_a_run_without_fields_says_how_to_keep_them(service: Server, pin: str) -> None:
    study = {"name": "bare", "scene": pin, "sweep": {"clearance": [0.03]}}
    (run,) = service.finished(service.post(study))["runs"]
    assert service.client.get(f"/runs/{run['id']}").json()["keep"] == ""
    refused = service.client.get(f"/runs/{run['id']}.vtu")
    assert refused.status_code == 422
    assert "keeps no fields" in refused.text


def test_all_mistakes_are_in_the_answer(service: Server) -> None:
    text = BLOCKS.replace('friction = "$mu"', "frictoin = 0.1")
    text = text.replace("value = 150.0", 'value = "much"')
    answer = post(service, text.encode())
    assert answer.status_code == 422
    told = {each["field"]: each["allowed"] for each in answer.json()["errors"]}
    assert "did you mean friction?" in told["contacts[0].frictoin"]
    allowed = "must be a number, a table or an expression of x and y; "
    assert told["loads[0].value"].startswith(allowed)
    assert "has no effect" in told["parameters.mu"]


def test_bodies_are_built_before_a_scene_is_kept(service: Server) -> None:
    before = service.client.get("/scenes").json()
    answer = post(service, BLOCKS.replace('boundary = "top"', 'boundary = "up"').encode())
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "loads[0].boundary"
    assert service.client.get("/scenes").json() == before


@pytest.mark.parametrize(
    ("scene", "meshes", "field", "words"),
    [
        (b"name = ", {}, "scene", "valid TOML"),
        (b"\xff\xfe", {}, "scene", "saved as UTF-8"),
        (PIN, {}, "bodies.plate.mesh", "no such file"),
        (PIN, {"pin_msh": b"$MeshFormat"}, "bodies.plate.mesh", "cannot be read"),
        (PIN, {"pin_msh": MESH, "other_msh": MESH}, "meshes", "that the scene names: pin.msh"),
        (PIN.replace(b"pin.msh", b"pin.xdmf"), {"pin_xdmf": MESH}, "meshes", "end in one of .msh"),
        (
            PIN.replace(b'"pin.msh"', b'"../pin.msh"'),
            {},
            "bodies.plate.mesh",
            "must be the name of a file",
        ),
        (
            PIN.replace(b'"pin.msh"', b'"/etc/passwd"'),
            {},
            "bodies.plate.mesh",
            "must be the name of a file",
        ),
    ],
)
def test_what_is_no_scene_is_refused_by_its_entry(
    service: Server, scene: bytes, meshes: dict[str, bytes], field: str, words: str
) -> None:
    answer = post(service, scene, **meshes)
    assert answer.status_code == 422, answer.text
    told = [each for each in answer.json()["errors"] if each["field"] == field]
    assert told and words in told[0]["allowed"], answer.json()["errors"]
    assert "/tmp" not in answer.text


def test_a_form_without_a_scene_and_other_bodies_are_refused(service: Server) -> None:
    lost = service.client.post("/scenes", files=[("meshes", ("pin.msh", MESH))])
    assert lost.status_code == 422
    assert lost.json()["errors"][0]["field"] == "scene"
    assert service.client.post("/scenes", json={}).status_code == 415
    headers = {"content-type": "multipart/form-data; boundary=x"}
    broken = service.client.post("/scenes", content=b"--y\r\n", headers=headers)
    assert broken.status_code == 400
    assert "form of files" in broken.json()["detail"]


def test_a_scene_larger_than_the_limit_is_refused(service: Server) -> None:
    answer = post(service, PIN, pin_msh=b"\n" * 21_000_000)
    assert answer.status_code == 413


@pytest.mark.parametrize("text", ["[[" + "x" * 200_000, "a = " + "[" * 100_000])
def test_text_that_is_hard_to_read_is_refused(service: Server, text: str) -> None:
    assert post(service, text.encode()).status_code == 422


def test_a_scene_file_has_at_most_a_million_bytes(service: Server) -> None:
    answer = post(service, b"# " + b"x" * 1_000_000)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["allowed"] == "must have at most 1000000 bytes"


def test_a_body_that_a_swept_value_spoils_is_refused_by_its_entry(service: Server) -> None:
    low = BLOCKS.replace("range = [1.0, 100.0]", "range = [-9.0, 100.0]").replace('"$wide/4"', "1")
    found = post(service, low.encode()).json()["id"]
    study = {"name": "spoiled", "scene": found, "sweep": {"wide": [4.0, -4.0]}}
    for route in ("/estimate", "/studies"):
        answer = service.client.post(route, json=study)
        assert answer.status_code == 422, answer.text
        (error,) = answer.json()["errors"]
        assert error["field"].startswith("bodies.upper.shape"), error


def test_reading_a_scene_holds_nobody_up(service: Server) -> None:
    """These tables take seconds to read; other requests are answered meanwhile."""
    key = ".".join("a" * 45)
    hard = "\n".join(f"[{key}.b{k}]" for k in range(4000)).encode()
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(post, service, hard)
        answered = 0
        while not waiting.done():
            assert service.client.get("/scenes/punch").status_code == 200
            answered += 1
        assert waiting.result().status_code == 422
    assert answered > 3


def test_a_mesh_that_takes_too_much_is_refused(service: Server) -> None:
    """The mesh claims four billion nodes: more than the memory of the process that reads it."""
    many = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4000000000 1 4000000000\n"
    bomb = f"{many}2 1 0 4000000000\n1\n$EndNodes\n".encode()
    answer = post(service, PIN, pin_msh=bomb)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["allowed"] == ALLOWED
    assert post(service, PIN, pin_msh=MESH).status_code in (200, 201), "the service goes on"


def test_the_command_submits_a_study_with_its_scene_file(service: Server, tmp_path: Path) -> None:
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    (tmp_path / "study.toml").write_text('name = "b"\nscene = "blocks.toml"\n[sweep]\nmu = [0.1]\n')
    command = [sys.executable, "-m", "residua", "submit", str(tmp_path / "study.toml"),
               "--url", str(service.client.base_url)]  # fmt: skip
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    study = Study.from_toml(tmp_path / "study.toml")
    assert answer.stdout.strip() == study.id
    done = service.finished(study.id)
    assert done["status"] == "successful"
    assert done["scene"] == study.problem.id
    assert tomllib.loads(BLOCKS)["name"] == "blocks"
