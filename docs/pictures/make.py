"""Make the pictures of the gallery: carry out the blocks of its page, in ``build/gallery``.

``python docs/pictures/make.py [NAME...]``; without names those of the part "In minutes".
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SECTION = re.compile(r"^### (?P<name>[\w-]+): .*?(?=^##|\Z)", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(
    r"^(?:<!-- file (?P<file>\S+) -->\n)?```(?P<language>console|python|toml)\n(?P<text>.*?)^```",
    re.MULTILINE | re.DOTALL,
)
LEFT_OUT = re.compile(r"^<!-- no-test -->\n```.*?^```", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"\(pictures/([\w.-]+)\)")
FOLDERS = ("data", "docs", "examples", "tests")
"""What the blocks name, besides their own results."""


def sections(page: str) -> dict[str, str]:
    """Return the text about each picture, by name."""
    return {match["name"]: match[0] for match in SECTION.finditer(page)}


def make(name: str, section: str, folder: Path) -> None:
    """Carry out the blocks of a section in a folder, and keep its pictures.

    Without blocks it takes those of the page of its name, such as the tutorial.
    """
    text = section
    if not BLOCK.search(text):
        text = LEFT_OUT.sub("", (ROOT / "docs" / f"{name}.md").read_text())
    paths = [str(Path(sys.executable).parent), os.environ["PATH"]]
    environment = os.environ | {"PATH": os.pathsep.join(paths), "PYTHONPATH": str(ROOT)}
    for block in BLOCK.finditer(text):
        if block["file"]:
            (folder / block["file"]).write_text(block["text"])
            continue
        commands = re.findall(r"^\$ ((?:residua|python|cp) .*)$", block["text"], re.MULTILINE)
        calls = [["bash", "-c", line] for line in commands]
        if block["language"] == "python":
            calls = [[sys.executable, "-c", block["text"]]]
        for call in calls:
            subprocess.run(call, cwd=folder, env=environment, check=True)
    for name in PICTURE.findall(section):
        with Image.open(folder / name) as picture:
            small = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
            small.save(HERE / name, optimize=True)


def main(names: list[str]) -> None:
    """Make the pictures of these names."""
    page = (ROOT / "docs" / "gallery.md").read_text()
    known, quick = sections(page), sections(page.partition("\n## Longer\n")[0])
    if unknown := set(names) - set(known):
        sys.exit(f"{', '.join(sorted(unknown))}: must be of {', '.join(known)}")
    folder = ROOT / "build" / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    for each in FOLDERS:
        if not (folder / each).exists():
            (folder / each).symlink_to(ROOT / each)
    for name in names or quick:
        print(name, flush=True)
        make(name, known[name], folder)


if __name__ == "__main__":
    main(sys.argv[1:])
