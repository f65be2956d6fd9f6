"""Check that worker processes can import the script that starts them."""

from __future__ import annotations

import ast
import inspect
import sys
from pathlib import Path
from types import FrameType

from solver.files import read_file
from studies.definition.identity import only_as_script
from studies.errors import StudyError

GUARD = 'if __name__ == "__main__":'


def check_script() -> None:
    """Refuse to start workers from a script that each worker would run again.

    A worker process imports the script that was started. If the script starts workers outside of
    `GUARD`, each worker would start more. A notebook, the interpreter's prompt and ``python -c``
    have no file to import.

    Raises
    ------
    StudyError
        naming the script and the line
    """
    file = getattr(sys.modules["__main__"], "__file__", None)
    line = _line_of(file) if file else None
    if file is None or line is None:
        return
    try:
        statements = ast.parse(read_file(file)).body
    except (OSError, SyntaxError, ValueError):  # not a Python source
        return
    if not any(only_as_script(each) and _guards(each, line) for each in statements):
        allowed = (
            f"line {line} must stand under `{GUARD}`, since worker processes import the script"
        )
        raise StudyError("script", Path(file).name, allowed)


def _guards(statement: ast.stmt, line: int) -> bool:
    """Whether a line is in the statement, or after it if it ends the module."""
    ends = isinstance(statement, ast.If) and isinstance(statement.body[-1], ast.Raise)
    return statement.lineno <= line and (ends or line <= (statement.end_lineno or line))


def _line_of(file: str) -> int | None:
    """Return the line of the script that is being run at module level."""
    frame: FrameType | None = inspect.currentframe()
    while frame is not None:
        if frame.f_globals is vars(sys.modules["__main__"]) and frame.f_code.co_name == "<module>":
            return frame.f_lineno if frame.f_code.co_filename == file else None
        frame = frame.f_back
    return None
