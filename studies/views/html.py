"""What writes HTML from templates: reports, short views in notebooks, pages of the service."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from studies.numbers import typeset
from studies.views.columns import value_text, words


@cache
def templates(package: str) -> Environment:
    """Return the templates of a package."""
    found = Environment(
        loader=PackageLoader(package),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    found.filters |= {
        "words": lambda name: words(str(name)),
        "number": number,
        "moment": lambda text: (text or "").replace("T", " ").removesuffix("+00:00"),
        "data": lambda content: json.dumps(content).replace("<", "\\u003c").replace("&", "\\u0026"),
    }
    return found


def number(value: Any) -> str:
    """Return a value as pages show it: numbers with four digits and a minus, "–" for none."""
    text = value_text(value)
    return typeset(text) if text == "-" or isinstance(value, int | float | np.floating) else text
