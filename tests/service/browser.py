"""A browser that watches the pages it opens: nothing may fail, and nothing leaves the host."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.service.servers import PATIENCE

ARGUMENTS = (
    "--no-sandbox", "--headless", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
GRAVE = ("serious", "critical")


@contextmanager
def chromium() -> Iterator[Any]:
    """Give Debian's Chromium; without it the tests are skipped."""
    found = shutil.which("chromium")
    if found is None:
        pytest.skip("chromium is not installed: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=[*ARGUMENTS])
        yield browser
        browser.close()


def patient(browser: Any, **given: Any) -> Any:
    """Return a context of the browser whose pages wait as long as other tests."""
    context = browser.new_context(**given)
    context.set_default_timeout(1000 * PATIENCE)
    return context


@contextmanager
def opened(context: Any, address: str, scheme: str = "light", width: int = 1280) -> Iterator[Any]:
    """Give a page; at the end nothing on it has failed, and it has asked no other host.

    Pages of one context share what the browser keeps, such as the compiled scripts.
    """
    page = context.new_page()
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 900})
    failed: list[str] = []
    page.on("pageerror", lambda error: failed.append(f"error: {error}"))
    page.on("console", lambda said: failed.append(said.text) if said.type == "error" else None)
    page.on(
        "request", lambda asked: failed.append(asked.url) if _outside(asked.url, address) else 0
    )
    page.goto(address)
    yield page
    page.close()
    assert not failed, failed


def _outside(address: str, base: str) -> bool:
    parts = urlsplit(address)
    return parts.scheme not in ("data", "blob") and parts.netloc != urlsplit(base).netloc


def barriers(page: Any, *rules: str) -> list[str]:
    """Return what axe-core finds on a page that is serious or worse, with the elements.

    Only these rules are checked, or all. What charts draw is left out: their figures have words.
    """
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(files("axe_core_python").joinpath("axe.min.js").read_text())
    what = {"resultTypes": ["violations"], **({"runOnly": [*rules]} if rules else {})}
    found = page.evaluate("what => axe.run({exclude: ['.plot-container']}, what)", what)[
        "violations"
    ]
    return [
        f"{each['id']}: {json.dumps([node['target'] for node in each['nodes']])}"
        for each in found
        if each["impact"] in GRAVE
    ]
