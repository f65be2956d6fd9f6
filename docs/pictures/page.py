"""Take a picture of the page of a study, as `residua view` shows it.

``python docs/pictures/page.py FOLDER PNG [QUERY]``; it needs Chromium.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

SIZE = {"width": 1280, "height": 990}


def main(folder: str, to: str, query: str = "") -> None:
    """Write the picture of the first study in a folder, with choices of the page as a query."""
    view = [Path(sys.executable).with_name("residua"), "view", folder, "--no-browser"]
    with subprocess.Popen(view, stdout=subprocess.PIPE, text=True) as service:
        address = next(word for line in service.stdout for word in line.split() if "://" in word)
        with sync_playwright() as driver:
            arguments = ["--no-sandbox", "--disable-background-networking"]
            browser = driver.chromium.launch(
                executable_path=shutil.which("chromium"), args=arguments
            )
            page = browser.new_page(viewport=SIZE)
            page.goto(address)
            if "/studies/" not in page.url:
                page.locator("a[href*='/ui/studies/']").first.click()
            page.goto(f"{page.url.partition('?')[0]}?{query}")
            page.wait_for_selector('[data-chart="map"]:not(.busy) .main-svg')
            page.wait_for_load_state("networkidle")
            page.screenshot(path=to)
            browser.close()
        service.terminate()


if __name__ == "__main__":
    main(*sys.argv[1:])
