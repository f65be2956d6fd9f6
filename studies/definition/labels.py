"""The entries ``note``, ``tags``, ``keep`` and ``allow`` of a study, and their check."""

from __future__ import annotations

from typing import Any

from studies.definition.sweep import checked_text
from studies.definition.vocabulary import FIELDS, LARGE_STRAIN
from studies.errors import StudyError

_MOST_TAGS, _LONGEST_NOTE = 20, 4000


def checked_labels(content: dict[str, Any]) -> dict[str, Any]:
    """Return those of ``note``, ``tags``, ``keep`` and ``allow`` that a study has.

    Raises
    ------
    StudyError
        if one of them has the wrong type or content
    """
    found = {
        "note": _note(content.get("note", "")),
        "tags": _tags(content.get("tags", [])),
        "keep": content.get("keep", ""),
        "allow": content.get("allow", []),
    }
    if found["keep"] not in ("", FIELDS):
        allowed = f'must be "{FIELDS}", or absent'
        raise StudyError("keep", found["keep"], allowed)
    if found["allow"] not in ([], [LARGE_STRAIN]):
        allowed = f'must be ["{LARGE_STRAIN}"], or absent'
        raise StudyError("allow", found["allow"], allowed)
    return {name: value for name, value in found.items() if value}


def _note(text: Any) -> str:
    short = isinstance(text, str) and len(text) <= _LONGEST_NOTE
    if short and all(letter.isprintable() or letter in "\n\t" for letter in text):
        return str(text)
    allowed = f"must be text of at most {_LONGEST_NOTE} characters, none of them a control"
    raise StudyError("note", text, allowed)


def _tags(tags: Any) -> list[str]:
    if not isinstance(tags, list) or len(tags) > _MOST_TAGS:
        raise StudyError("tags", tags, f"must be a list of at most {_MOST_TAGS} texts")
    for k, tag in enumerate(tags):
        checked_text(f"tags[{k}]", tag)
        if tag in tags[:k]:
            raise StudyError(f"tags[{k}]", tag, "is there already")
    return tags
