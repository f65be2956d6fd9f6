"""Programs in Python, each in a process of its own that finds the libraries loaded.

They are forks of one process for all, which has loaded what programs load first of all, for a
second of CPU, but nothing of this project: that each program imports itself.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Mapping
from importlib import import_module
from multiprocessing import process
from pathlib import Path
from types import ModuleType
from typing import NoReturn, Self

LIBRARIES = (
    "dask.array", "h5netcdf", "jinja2", "matplotlib.backends.backend_agg", "matplotlib.figure",
    "multiprocessing.pool", "netCDF4", "numba", "pandas", "pint", "pydantic.type_adapter",
    "scipy.optimize", "scipy.sparse.linalg", "scipy.special", "skfem.helpers", "sqlite3", "xarray",
)  # fmt: skip
LASTS = 300
"""Seconds after which a program is ended."""


class Programs:
    """The process whose forks are programs; it is started for the first one."""

    def __init__(self) -> None:
        self._server: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._server is not None:
            self._server.communicate()

    def run(
        self, file: Path, folder: Path, environment: Mapping[str, str], strict: bool = False
    ) -> subprocess.CompletedProcess[str]:
        """Run a file in a folder as ``python FILE`` does; if `strict`, warnings are errors."""
        if self._server is None:
            self._server = subprocess.Popen(
                [sys.executable, "-m", __name__],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                cwd=Path(__file__).parents[1],
            )  # fmt: skip
        assert self._server.stdin and self._server.stdout
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
            told = {
                "file": str((folder / file).resolve()),
                "folder": str(folder),
                "environment": dict(environment),
                "strict": strict,
                "output": [f"/proc/{os.getpid()}/fd/{each.fileno()}" for each in (out, err)],
            }
            print(json.dumps(told), file=self._server.stdin, flush=True)
            code = int(self._server.stdout.readline())
            out.seek(0)
            err.seek(0)
            return subprocess.CompletedProcess([str(file)], code, out.read(), err.read())


def serve() -> None:
    """Load the libraries, run what each line of the input tells, and answer how it ended."""
    for library in LIBRARIES:
        import_module(library)
    while line := sys.stdin.readline():
        if (program := os.fork()) == 0:
            become(**json.loads(line))
        _, status = os.waitpid(program, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def become(
    file: str, folder: str, environment: dict[str, str], strict: bool, output: list[str]
) -> NoReturn:
    """Make this process the one of a program, and end with it."""
    for number, name in enumerate([os.devnull, *output]):
        mode = os.O_RDWR if number else os.O_RDONLY
        os.dup2(os.open(name, mode), number)
    signal.alarm(LASTS)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    process.ORIGINAL_DIR = folder  # type: ignore[attr-defined]
    own = [str(Path(file).parent), *filter(None, environment.get("PYTHONPATH", "").split(":"))]
    sys.path[:] = [*own, *sys.path[1:]]
    sys.argv[:] = [file]
    if strict:
        warnings.simplefilter("error")
    main = sys.modules["__main__"] = ModuleType("__main__")
    main.__file__ = file
    code: object = 1
    try:
        exec(compile(Path(file).read_bytes(), file, "exec"), vars(main))
        code = 0
    except SystemExit as asked:
        code = asked.code
        if not isinstance(code, int | None):
            print(code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    # Freeing what the libraries hold, one object after the other, takes half a second.
    os._exit(code if isinstance(code, int) else code is not None)


if __name__ == "__main__":
    serve()
