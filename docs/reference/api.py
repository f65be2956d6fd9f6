"""Write the reference of the public names in Python, as HTML.

``python docs/reference/api.py FOLDER``; `make docs` calls it so that a warning is an error.
"""

from __future__ import annotations

import sys
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import get_type_hints

import pdoc

PACKAGES = ("solver", "solver.materials", "solver.mesh", "solver.scenes", "studies")
"""Packages whose names in ``__all__`` are for users."""


def _maker(public: object) -> FunctionType | None:
    """Return the function with which a class of fields makes an object."""
    if is_dataclass(public):
        return public.__init__
    return getattr(public, "__new__", None) if hasattr(public, "_fields") else None


def main(folder: Path) -> None:
    """Write a page for each package."""
    for name in PACKAGES:
        package = import_module(name)
        for each in package.__all__:
            public = getattr(package, each)
            setattr(package, each, public)  # else imported at first use
            if maker := _maker(public):  # an inherited field names types of another module
                maker.__annotations__ |= get_type_hints(public, include_extras=True)
    pdoc.render.configure(docformat="numpy", show_source=False)
    pdoc.pdoc(*PACKAGES, output_directory=folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
