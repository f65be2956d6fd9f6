"""The pages as people meet them, in Debian's Chromium."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from service.keys import Keys, Scope
from studies import open_study
from tests.service.browser import barriers, chromium, opened, patient
from tests.service.servers import COARSE_PUNCH, NOWHERE, Server, fake_study

STUDY = {
    "name": "seen",
    "scene": "punch",
    "tags": ["brochure"],
    "note": "Looked at by the tests.",
    "parameters": {**COARSE_PUNCH, "hardening": "isotropic"},
    "sweep": {"load_ratio": [0.4, 0.8], "friction": [0.0, 0.3]},
}
NUMBER = "peak_contact_pressure"
DRAWN = "[data-chart={}] .plot-container"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def context(browser: Any) -> Any:
    """Give what the pages of most tests share; a page has a session of its own."""
    return patient(browser)


@pytest.fixture(scope="module")
def study(service: Server, browser: Any) -> str:
    study_id = service.post(STUDY)
    assert service.finished(study_id)["status"] == "successful"
    return study_id


@pytest.fixture(scope="module")
def open_study_page(context: Any, service: Server, study: str) -> Iterator[Any]:
    """Give the page of the study, which tests share: each says what of it is drawn."""
    with opened(context, f"{base(service)}/ui/studies/{study}") as page:
        page.wait_for_selector("[data-chart=sweep] .heatmaplayer image")
        yield page


@pytest.fixture(scope="module")
def dataset(service: Server, study: str) -> xr.Dataset:
    return open_study(f"http://127.0.0.1:{service.port}/studies/{study}")


WHOLE = ".list td:has(.status), .differ tr:first-child td.right, .scroll .audit td:last-child, pre"
"""What a phone shows whole: status of studies, numbers of two runs, audit, code."""


def base(server: Server) -> str:
    return f"http://127.0.0.1:{server.port}"


def runs(server: Server, study: str) -> list[str]:
    """Return the ids of the runs of a study, in the order of the sweep."""
    return [run["id"] for run in server.study(study)["runs"]]


def cell(page: Any, x: float, y: float) -> tuple[float, float]:
    """Return the place of a cell of the heat map on the screen."""
    return page.evaluate(
        """([x, y]) => {
            const chart = document.querySelector("[data-chart=sweep]");
            const { xaxis, yaxis } = chart._fullLayout, box = chart.getBoundingClientRect();
            return [box.x + xaxis._offset + xaxis.d2p(x), box.y + yaxis._offset + yaxis.d2p(y)];
        }""",
        [x, y],
    )


def test_no_page_has_a_serious_barrier_or_is_wider_than_a_phone(
    context: Any, open_study_page: Any, service: Server, study: str
) -> None:
    run, *_ = runs(service, study)
    every = "&".join(f"run={each}" for each in runs(service, study))
    waited = {
        "/ui": "table.list",
        f"/ui/runs/{run}": DRAWN.format("map"),
        f"/ui/compare?{every}": "table.differ",
        "/ui/new?scene=punch": "[data-estimate] dd",
        "/ui/health": ".tiles",
        "/ui/sign-in": "form.stack",
    }
    open_study_page.wait_for_selector(DRAWN.format("map"))
    see(open_study_page, dark=True)
    open_study_page.set_viewport_size({"width": 1280, "height": 900})
    open_study_page.emulate_media(color_scheme="light")
    for path, there in waited.items():
        with opened(context, base(service) + path) as page:
            page.wait_for_selector(there)
            see(page, dark="new" in path)  # the others have the same colours
            for cut in page.locator(WHOLE).all():
                box = cut.bounding_box()
                assert box is None or box["x"] + box["width"] < 380, page.url
            for label in page.locator(".differ tbody th[scope=row]").all():
                assert label.bounding_box()["width"] > 70.0


def see(page: Any, *, dark: bool) -> None:
    """Look for barriers, also in the dark, and at the width of a phone."""
    assert not barriers(page), page.url
    if dark:
        page.emulate_media(color_scheme="dark")
        assert not barriers(page, "color-contrast"), page.url
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390, page.url


def test_values_under_the_pointer_and_of_a_clicked_run_are_those_of_the_data_set(
    open_study_page: Any, service: Server, study: str, dataset: xr.Dataset
) -> None:
    page = open_study_page
    page.select_option("[data-controls=sweep] select >> nth=0", NUMBER)
    page.wait_for_selector("[data-chart=sweep] .heatmaplayer image")
    shown = page.evaluate("document.querySelector('[data-chart=sweep]').data[0].z")
    stored = dataset[NUMBER].isel(hardening=0).transpose("load_ratio", "friction")
    assert np.array_equal(shown, stored)
    page.wait_for_selector("[data-chart=sweep][data-ready]")
    page.wait_for_selector(DRAWN.format("map"))
    page.mouse.move(*cell(page, 0.3, 0.8))
    said = page.locator(".hoverlayer .hovertext").text_content()
    value = stored.sel(friction=0.3, load_ratio=0.8).item()
    assert float(re.search(r"[\d.]+", said)[0]) == float(f"{value:.4g}")
    run = chosen_id(service, study, 0.4, 0.0)
    page.mouse.move(*cell(page, 0.0, 0.4))
    page.wait_for_selector(".hoverlayer .hovertext:has-text('load ratio 0.4')")
    with page.expect_response(f"**/runs/{run}/values?field=residual_stress**"):
        page.mouse.click(*cell(page, 0.0, 0.4))
    page.wait_for_selector("[data-chart=map]:not(.busy)")
    assert f"run={run}" in page.url
    at = dataset.isel(hardening=0).sel(friction=0.0, load_ratio=0.4)
    main = page.locator(".figures .main dd").inner_text()
    assert main.split()[0] == f"{at[NUMBER].item():.4g}"
    x, z = page.evaluate(
        "(({x, z}) => [[...x], z.map((row) => [...row])])"
        "(document.querySelector('[data-chart=map]').data[0])"
    )
    half = np.array(z, dtype=np.float32)[:, np.array(x) >= 0.0]
    stored = at["residual_stress"].sel(component="xx").to_numpy().astype(np.float32)
    assert np.array_equal(half, stored, equal_nan=True)


def chosen_id(server: Server, study: str, load: float, friction: float) -> str:
    found = server.study(study)["runs"]
    wanted = {"load_ratio": load, "friction": friction}
    (run,) = [run["id"] for run in found if wanted.items() <= run["at"].items()]
    return run


def test_the_table_is_sorted_and_filtered(open_study_page: Any) -> None:
    page = open_study_page
    page.fill("[name='where.friction']", "0.1..0.4")
    page.click("text=Filter")
    page.wait_for_selector(".lead:has-text('2 of 4')")
    page.click(".runs thead a:has-text('load ratio')")
    page.wait_for_selector(".runs th[aria-sort=descending]")
    loads = page.locator(".runs tbody tr td:nth-child(2)").all_inner_texts()
    assert loads == ["0.8", "0.4"]
    assert "sort=-load_ratio" in page.url and "where.friction=0.1..0.4" in page.url
    page.click("text=All runs")
    page.wait_for_selector(".lead:has-text('4 of 4')")
    assert "where" not in page.url


def test_a_range_drawn_on_a_parallel_axis_is_a_condition_of_the_table(
    open_study_page: Any,
) -> None:
    page = open_study_page
    page.locator(".parallel").scroll_into_view_if_needed()
    page.wait_for_selector(".parallel.drawn")
    box = page.locator("[data-parallel]").bounding_box()
    x, top, low = box["x"] + 66, box["y"] + 76, box["y"] + box["height"] - 17
    page.mouse.move(x, top)
    page.mouse.down()
    page.mouse.move(x, top + 0.3 * (low - top))
    page.mouse.up()
    page.wait_for_selector(".lead:has-text('2 of 4')")
    assert {*page.locator(".runs tbody tr td:nth-child(1)").all_inner_texts()} == {"0.3"}
    name = page.evaluate(
        "[...new URLSearchParams(location.search)].find(([n]) => n.match('where'))"
    )
    assert name[0] == "where.friction" and float(name[1].split("..")[1]) == 0.3
    page.mouse.click(x, top + 0.5 * (low - top))
    page.wait_for_selector(".lead:has-text('4 of 4')")
    last = box["x"] + box["width"] - 66
    for begin, end in ((top, top + 20), (low, low - 20)):  # the outermost run of a number stays
        page.mouse.move(last, begin)
        page.mouse.down()
        page.mouse.move(last, end)
        page.mouse.up()
        page.wait_for_selector(".runs tbody tr:only-child, .runs tbody tr:nth-child(2):last-child")
        page.mouse.click(last, top + 0.5 * (low - top))
        page.wait_for_selector(".lead:has-text('4 of 4')")
    page.mouse.move(box["x"] + 100, low - 3)
    assert page.locator("[data-tip]").inner_text().splitlines()[1:] == [
        "friction 0",
        "load ratio 0.4",
    ]


def test_contours_and_marks_show_the_runs_as_they_are_stored(
    open_study_page: Any, dataset: xr.Dataset
) -> None:
    page, stored = open_study_page, dataset[NUMBER].isel(hardening=0)
    page.select_option("[data-controls=sweep] select >> nth=0", NUMBER)
    for kind, there in (("Contours", ".contourlayer"), ("Marks", ".scatterlayer .point")):
        page.click(f"[data-controls=sweep] button:text-is('{kind}')")
        page.wait_for_selector(f"[data-chart=sweep] {there}")
        said = page.evaluate(
            "document.querySelector('[data-chart=sweep]').data.filter((each) => each.text).at(0)"
        )
        assert len(said["text"]) == stored.size
        for x, y, text in zip(said["x"], said["y"], said["text"], strict=True):
            at = {"friction": x, "load_ratio": y}
            if kind == "Marks":
                at = {"load_ratio": x, "friction": y}
            value = stored.sel(at).item()
            assert text.startswith(f"<b>{float(f'{value:.4g}'):g} MPa</b>")
            assert f"friction {at['friction']:g}" in text
    assert "kind=marks" in page.url


def test_runs_are_chosen_by_keys_and_compared(context: Any, service: Server, study: str) -> None:
    first, other, last = (
        chosen_id(service, study, *at) for at in ((0.4, 0.0), (0.8, 0.0), (0.8, 0.3))
    )
    with opened(context, f"{base(service)}/ui/studies/{study}?run={first}") as page:
        page.wait_for_selector("[data-chart=sweep] .heatmaplayer image")
        page.click("[data-compare]")
        page.focus("[data-chart=sweep]")
        page.keyboard.press("ArrowUp")
        page.wait_for_url(f"**run={other}**")
        page.keyboard.press("ArrowRight")
        page.wait_for_url(f"**run={last}**")
        page.click("[data-compare]")
        page.click("[data-comparison]")
        page.wait_for_selector(DRAWN.format("difference"))
        rows = page.locator(".differ tbody th").all_inner_texts()
        assert {"friction", "load ratio"} <= {*rows} and "yield stress" not in rows
        page.select_option("[data-controls=difference] select >> nth=-1", "0")
        page.wait_for_url("**second=0**")
        see(page, dark=False)
        assert f"run={first}&run={last}" in page.url


def test_numbers_over_words_are_marks_without_lines(context: Any, service: Server) -> None:
    laws = {"name": "laws", "scene": "fake", "sweep": {"hardening": ["none", "isotropic"]}}
    study_id = service.post(laws)
    assert service.finished(study_id)["status"] == "successful"
    with opened(context, f"{base(service)}/ui/studies/{study_id}") as page:
        page.wait_for_selector("[data-chart=sweep] .scatterlayer .point")
        drawn = page.evaluate("document.querySelector('[data-chart=sweep]').data[0]")
        assert (drawn["mode"], drawn["x"]) == ("markers", ["none", "isotropic"])


def test_charts_take_text_of_others_as_text(open_study_page: Any) -> None:
    title = open_study_page.evaluate(
        """async () => {
            const style = document.querySelector("link[rel=stylesheet]").href;
            const { named } = await import(style.replace("style.css", "charts.js"));
            const chart = document.querySelector("[data-chart=sweep]");
            const text = named("<a href='/x'>a & b", "1/s");
            await Plotly.relayout(chart, { "xaxis.title.text": text });
            const drawn = chart.querySelector(".xtitle");
            return [drawn.querySelectorAll("a").length, drawn.textContent];
        }"""
    )
    assert title == [0, "<a href='/x'>a & b [1/s]"]


def test_a_study_of_points_is_watched_to_its_end_and_its_runs_are_marks(
    context: Any, service: Server
) -> None:
    points = [
        {"load_ratio": 0.2, "friction": 0.1},
        {"load_ratio": 0.4, "friction": 0.05},
        {"load_ratio": 0.3, "friction": 0.2, "behaviour": "limit"},
    ]
    watched = {"name": "watched", "scene": "fake", "parameters": {"seconds": 0.5}}
    study_id = service.post(watched | {"points": points})
    with opened(context, base(service) + f"/ui/studies/{study_id}?x=load_ratio") as page:
        page.wait_for_selector("[data-live=status] .failed")
        page.wait_for_selector(".counts li:has(.ok) b")
        assert page.locator(".counts li:has(.ok) b").inner_text() == "2"
        assert page.locator(".runs tbody .status.limit_load").count() == 1
        page.wait_for_selector(
            "[data-note=sweep]:has-text('Of 3 runs shown, without a value: 1 no')"
        )
        shown = page.evaluate(
            "document.querySelector('[data-chart=sweep]').data.filter((each) => each.text)"
            ".map(({ name, x, y, text }) => [name ?? '', x, y, text])"
        )
        (_, x, y, _), (reason, u, v, said) = shown
        assert {*zip(x, y, strict=True)} == {(0.2, 0.1), (0.4, 0.05)}
        assert (reason, u, v) == ("no equilibrium", [0.3], [0.2])
        assert "load ratio 0.3" in said[0] and "friction 0.2" in said[0]
    for run, cards in zip(runs(service, study_id), (True, True, False), strict=True):
        assert ("data-picture" in service.client.get(f"/ui/runs/{run}").text) == cards


def test_a_study_is_made_by_the_form(context: Any, service: Server) -> None:
    with opened(context, base(service) + "/ui/new?scene=fake") as page:
        page.fill("[name=name]", "by-form")
        page.fill("[name='p.friction']", "0, 0.3")
        page.fill("[name='p.load_ratio']", "much")
        page.wait_for_selector("[data-wrong=load_ratio]:has-text('finite number')")
        assert page.get_attribute("[name='p.load_ratio']", "aria-invalid") == "true"
        page.fill("[name='p.load_ratio']", "0.1 .. 0.5 in 3")
        page.wait_for_selector("[data-estimate] dd:has-text('6')")
        assert page.locator("[data-wrong=load_ratio]").inner_text() == ""
        assert "load_ratio = {start = 0.1, stop = 0.5, num = 3}" in page.inner_text(
            ".code >> nth=0"
        )
        page.click("button[name=submit]")
        page.wait_for_selector("[data-live=status] .successful")
        assert page.locator(".runs tbody tr").count() == 6


def test_a_scene_that_is_refused_stays_chosen(
    context: Any, service: Server, tmp_path: Path
) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text('name = "wrong"\n')
    page = context.new_page()  # not `opened`: the browser reports the answer 422 as an error
    page.goto(f"{base(service)}/ui/new")
    page.click(".drop summary")
    page.set_input_files("[name=scene][type=file]", str(file))
    page.click("text=Post it")
    page.wait_for_selector(".drop [role=alert] li")
    assert "wrong.toml is not taken" in page.locator(".drop [role=alert]").text_content()
    names = "document.querySelector('[name=scene][type=file]').files[0].name"
    assert page.evaluate(names) == "wrong.toml"
    page.route("**/ui/*", lambda route: route.abort())
    page.click("text=Post it")
    page.wait_for_selector(".drop [role=alert]:has-text('the service cannot be reached')")
    page.fill("[name=name]", "lost")
    page.wait_for_selector("[data-wrong='']:has-text('the service cannot be reached')")
    page.close()


def test_a_page_without_scripts_has_table_and_picture(
    browser: Any, service: Server, study: str
) -> None:
    plain = patient(browser, java_script_enabled=False)
    with opened(plain, f"{base(service)}/ui/studies/{study}") as page:
        assert page.locator(".runs tbody tr").count() == 4
        size = page.locator("[data-chart=map] img").evaluate("image => image.naturalWidth")
        assert size > 300


@pytest.fixture(scope="module")
def locked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, dict[Scope, str]]]:
    """Give a service that requires keys, and a key of each scope."""
    settings = NOWHERE | {"RESIDUA_REQUIRE_KEYS": "true"}
    server = Server(tmp_path_factory.mktemp("locked"), settings=settings)
    server.data.mkdir(parents=True)
    keys = {scope: Keys(server.data).add(f"of-{scope}", scope) for scope in Scope}
    yield server.start(), keys
    server.close()


def test_a_caller_signs_in_and_out(browser: Any, locked: tuple[Server, dict[Scope, str]]) -> None:
    server, keys = locked
    answer = server.client.post(
        "/studies", json=fake_study("kept"), headers={"authorization": f"Bearer {keys['submit']}"}
    )
    page_of = f"/ui/studies/{answer.json()['id']}"
    with opened(patient(browser), base(server) + page_of) as page:
        assert "/ui/sign-in" in page.url
        page.fill("[name=key]", keys[Scope.SUBMIT])
        page.click("text=Sign in >> nth=-1")
        page.wait_for_selector("h1:has-text('kept')")
        assert page.url.endswith(page_of)
        (cookie,) = page.context.cookies()
        assert cookie["httpOnly"] and cookie["sameSite"] == "Strict"
        assert page.evaluate("document.cookie") == ""
        page.click("button >> text=Stop")
        page.wait_for_selector("[data-live=status] .dismissed")
        page.click("text=Sign out")
        page.wait_for_selector("[name=key]")
        assert not page.context.cookies()


def test_a_wrong_key_and_a_weak_one_are_refused(
    browser: Any, locked: tuple[Server, dict[Scope, str]]
) -> None:
    server, keys = locked
    headers = {"authorization": f"Bearer {keys[Scope.ADMIN]}"}
    answer = server.client.post("/studies", json=fake_study("other"), headers=headers)
    study_id = answer.json()["id"]
    context = patient(browser, base_url=base(server))
    page = context.new_page()
    page.goto("/ui/sign-in")
    page.fill("[name=key]", "residua_wrong")
    page.click("text=Sign in >> nth=-1")
    assert "not known" in page.locator("[role=alert]").inner_text()
    page.fill("[name=key]", keys[Scope.READ])
    page.click("text=Sign in >> nth=-1")
    page.goto(f"/ui/studies/{study_id}")
    assert page.locator("button >> text=Stop").count() == 0
    refused = page.evaluate(
        "id => fetch(`/ui/studies/${id}/stop`, {method: 'POST', headers:"
        " {'content-type': 'application/x-www-form-urlencoded'}}).then((each) => each.status)",
        study_id,
    )
    assert refused == 403
    assert server.client.get(f"/studies/{study_id}", headers=headers).json()["status"] in (
        "accepted",
        "running",
    )
    context.close()
