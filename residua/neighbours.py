"""Whether the packages that Python finds are those of this command.

Their names are common words. Another package of the same name, or a folder in the directory where
Python was started, may come first; then an import fails with an error that does not tell why.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

NEIGHBOURS = ("solver", "studies", "service")
"""The packages that stand beside this one."""


def stranger() -> str:
    """Return one line about a package that is not the one beside this; nothing where all are.

    No package is imported for that.
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
    """Return the folder of a package, or the file of a module; None where Python finds neither."""
    spec = find_spec(name)
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    return Path(folders[0] if folders else str(spec.origin))
