"""Check that Python finds the packages of this command, and no others of the same names.

Their names are common words. Another package of the same name, or a folder in the directory where
Python was started, may be found first; an import then fails with an error that is hard to
understand.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

NEIGHBOURS = ("solver", "studies", "service")
"""The packages that must be in the same folder as this one."""


def wrong_package() -> str:
    """Return one line about the first package that Python finds elsewhere; empty if none.

    No package is imported for this check.
    """
    home = Path(__file__).parents[1]
    for name in NEIGHBOURS:
        found, own = _place(name), home / name
        if found is None:
            return f"Python finds no package {name!r}; this command needs the one at {own}"
        if found.resolve() != own.resolve():
            return (
                f"Python finds the package {name!r} at {found}; this command needs the one at "
                f"{own}: rename the other one, or take its folder off Python's path"
            )
    return ""


def _place(name: str) -> Path | None:
    """Return the folder of a package, or the file of a module; None if Python finds neither."""
    spec = find_spec(name)
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    return Path(folders[0] if folders else str(spec.origin))
