"""API keys of the service, made and read, and certificates of scheduler and workers."""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path
from typing import Any

from residua.status import OK
from solver.files import read_file
from studies.errors import StudyError


def keys(options: argparse.Namespace) -> int:
    """Make, list or remove the API keys of a service."""
    from service.keys import Keys, KeysError
    from service.settings import Settings
    from studies.storage.blobs import directory_of

    # The other settings do not matter here, and may name files that do not exist yet.
    data = options.data or os.environ.get("RESIDUA_DATA") or Settings.model_fields["data"].default
    try:
        options.act(Keys(directory_of(data)), options)
    except KeysError as error:
        raise OSError(str(error)) from None
    return OK


def add(known: Any, options: argparse.Namespace) -> None:
    """Make a key and print it; a running service accepts it at once."""
    print(known.add(options.name, options.scope))
    print("residua: keep the key now; it is not stored and not shown again", file=sys.stderr)


def list_(known: Any, options: argparse.Namespace) -> None:
    """Print the name, the scope and the time of each key."""
    for name, key in known.all().items():
        print(f"{name}  {key.scope}  {key.created:%Y-%m-%d %H:%M} UTC")


def remove(known: Any, options: argparse.Namespace) -> None:
    """Remove a key; a running service refuses it at once."""
    known.remove(options.name)


def certificates(options: argparse.Namespace) -> int:
    """Write a certificate and key each for scheduler, workers and service."""
    from studies.execution.certificates import write_certificates

    for path in write_certificates(options.out):
        print(f"wrote {path}")
    return OK


def api_key(path: Path | None) -> str | None:
    """Return the key in the file ``path``, or in the environment; errors never show the key."""
    if path is None:
        return _plain("RESIDUA_API_KEY", os.environ.get("RESIDUA_API_KEY", "")) or None
    try:
        text = read_file(path).decode("ascii", "replace")
    except OSError as error:  # the text may be the key itself, typed by mistake: do not show it
        allowed = f"must be a file that contains the key: {error.strerror}"
        raise StudyError("--api-key-file", "…", allowed) from None
    return _plain("--api-key-file", text)


def _plain(source: str, text: str) -> str:
    """Return the key, or raise `StudyError` if a header cannot contain it."""
    key = text.strip()
    if not re.fullmatch(r"[\w-]*", key, re.ASCII):
        raise StudyError(source, "…", "must hold one key: letters, digits, '-' and '_'")
    return key
