"""The arguments of the command ``residua``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from residua import commands, keys
from residua.status import BAD_INPUT, complain
from solver.version import __version__
from studies.errors import StudyError
from studies.execution.executor import Limits
from studies.storage.blobs import directory_of, is_address

Add = Callable[..., argparse.ArgumentParser]
"""Adds a subcommand, and returns its parser."""


def parser() -> argparse.ArgumentParser:
    """Return the parser; `command` of its options is the function that carries them out."""
    whole = _Parser(prog="residua", description="Residual stress after elastic-plastic contact.")
    whole.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    known = whole.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, command: Any, **defaults: Any) -> argparse.ArgumentParser:
        text = defaults.get("talk", command).__doc__
        one = known.add_parser(name, help=text, description=text)
        one.set_defaults(command=command, **defaults)
        return one

    _add_run(add("run", commands.run))
    one = add("fit", commands.fit)
    one.add_argument(
        "--measured", type=_path, nargs="+", default=[], metavar="CSV[@NAME=VALUE]",
        help="measured lines: columns PLACE and VALUE, named as variables of the runs, and sigma; "
        "NAME=VALUE tells the place on other dimensions, such as stage=unloaded",
    )  # fmt: skip
    _add_run(one)

    one = add("scenes", commands.scenes)
    one.add_argument("name", nargs="?")

    _of_study(add, "show", commands.show, _store, "DIR|RUN")

    one = _of_study(add, "export", commands.export, _store, "RUN|DIR")
    _several(one, "--select", "NAME=VALUE")
    one.add_argument(
        "--vtu", type=_path, metavar="FOLDER", help="fields at the nodes, for ParaView"
    )
    one.add_argument("--csv", type=_path, metavar="FILE", help="a line for each value of --field")
    one.add_argument(
        "--crate", type=_path, metavar="FOLDER",
        help="the whole study as an RO-Crate, which `residua run FOLDER` computes again",
    )  # fmt: skip
    one.add_argument("--field", help="a map or lines, such as residual_stress")
    one.add_argument("--component", help="of a tensor; default: the first")
    one.add_argument("--stage", help="of a map; default: the last")

    one = add("serve", commands.serve)
    one.add_argument("--host", help="default: 127.0.0.1; with another one callers need API keys")
    one.add_argument("--port", type=_integer(0, 65535), help="default: 8000")
    one.add_argument("--data", type=_store, metavar="DIR", help="default: out")
    one.add_argument("--scheduler", metavar="ADDRESS", help="use a running dask scheduler")

    one = _of_study(add, "view", commands.view, _store, "DIR|DATASET")
    one.add_argument(
        "--port", type=_integer(0, 65535), default=0, help="default: any port that is free"
    )
    one.add_argument("--no-browser", action="store_true", help="print the address alone")

    one = _of_study(add, "report", commands.report, _place, "DIR|DATASET")
    one.add_argument(
        "--out", "-o", type=_path, default=Path("report.html"), metavar="HTML",
        help="default: %(default)s",
    )  # fmt: skip

    for more in (_add_pictures, _add_cluster, _add_numbers, _add_access, _add_remote):
        more(add)
    return whole


class _Parser(argparse.ArgumentParser):
    """Tells a mistake in one line, as the commands do."""

    def error(self, message: str) -> NoReturn:
        sys.exit(complain(f"{message} (--help lists what is allowed)", BAD_INPUT))


def _of_study(
    add: Add, name: str, command: Any, kind: Callable[[str], Any], metavar: str
) -> argparse.ArgumentParser:
    """Return the parser of a command on a study, or a run, that is there."""
    one = add(name, command)
    one.add_argument("path", type=kind, metavar=metavar)
    one.add_argument(
        "--study", metavar="NAME|ID|latest", help="of the studies in a folder, as DIR/NAME says too"
    )
    return one


def _results(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--out", type=_store, default=Path("out"), metavar="DIR",
        help="folder of all results, which studies share, or an address such as s3://bucket/x "
        "(default: %(default)s)",
    )  # fmt: skip


def _add_pictures(add: Add) -> None:
    one = add("draw", commands.draw)
    one.add_argument(
        "what", metavar="SCENE|STUDY.toml",
        help="name of a scene, its file, or a study, whose first run is drawn",
    )  # fmt: skip
    words = "parameters, in place of those of the study or the defaults"
    _several(one, "--set", "NAME=VALUE", words)
    one.add_argument("--zoom", type=float, metavar="MM", help="only within this distance of 0, 0")
    _add_window(one)

    one = _of_study(add, "plot", commands.plot, _place, "RUN|DIR")
    own = "of the sweep, or of the field's own dimensions, such as pass=2"
    _several(one, "--select", "NAME=VALUE", own)
    one.add_argument("--field", help="default: residual_stress, or map_stress if not released")
    one.add_argument("--component")
    one.add_argument(
        "--zoom", type=float, metavar="MM",
        help="only within this distance of the contact's centre, or of its edge if half of the "
        "bodies was computed",
    )  # fmt: skip
    one.add_argument(
        "--over",
        metavar="AXIS",
        help="draw lines for each value of this axis, or dimension of the field",
    )
    one.add_argument(
        "--against", metavar="NAME",
        help="draw lines over increments over this variable, such as a motion: a loop",
    )  # fmt: skip
    one.add_argument(
        "--deformed", type=float, metavar="FACTOR",
        help='draw the bodies of a map deformed, of a study with keep = "fields"',
    )  # fmt: skip
    _add_window(one)


def _add_window(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--window", type=float, nargs=4, metavar=("X0", "X1", "Y0", "Y1"),
        help="only this part [mm]",
    )  # fmt: skip
    one.add_argument("--resolution", type=float, metavar="DPI", help="dots per inch, 50 to 600")
    one.add_argument("--out", type=_path, required=True, metavar="PNG")


def _add_run(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "study", type=_path, metavar="STUDY.toml|CRATE", help="a study file, or an exported crate"
    )
    _results(one)
    one.add_argument(
        "--workers", type=_integer(0, 1024),
        help="processes; 0: this one (default: one per core, 0 for a study of some seconds)",
    )  # fmt: skip
    where = one.add_mutually_exclusive_group()
    where.add_argument("--scheduler", metavar="ADDRESS", help="use a running dask scheduler")
    where.add_argument(
        "--scheduler-file", type=_path, metavar="FILE",
        help="the same, by the file to which it writes its address",
    )  # fmt: skip
    where.add_argument(
        "--part", type=_part, metavar="I/N",
        help="compute as one of N processes that share the directory, and combine nothing",
    )  # fmt: skip
    for name, what in (("ca", "authority"), ("cert", "own certificate"), ("key", "own key")):
        one.add_argument(f"--tls-{name}", metavar="PEM", help=f"{what} for a tls:// scheduler")
    one.add_argument(
        "--stall-seconds", type=float, metavar="S", default=Limits().stall_seconds,
        help="end a path after this time without progress (default: %(default)g)",
    )  # fmt: skip
    one.add_argument("--path-seconds", type=float, metavar="S", help="end a path after this time")
    one.add_argument("--memory", metavar="SIZE", help="largest memory of a process, such as 2GB")
    one.add_argument(
        "--patience", type=float, metavar="S",
        help="end after this time without a worker that accepts tasks (default: wait)",
    )  # fmt: skip
    one.add_argument("--resume", action="store_true", help="do not try failed runs again")
    one.add_argument("--dry-run", action="store_true", help="print the estimated cost, and end")


def _add_cluster(add: Add) -> None:
    one = add("slurm", commands.slurm)
    one.add_argument("study", type=_path, metavar="STUDY.toml")
    _results(one)
    one.add_argument("--tasks", type=_integer(1, 10**6), default=16, help="default: %(default)s")
    one.add_argument("--time", default="04:00:00", help="limit of a task (default: %(default)s)")
    one.add_argument("--memory", default="2G", help="of a task (default: %(default)s)")
    one.add_argument(
        "--with-scheduler", action="store_true",
        help="the tasks are workers of a scheduler, in place of parts that share a directory",
    )  # fmt: skip
    one.add_argument("--script", type=_path, required=True, metavar="FILE", help="what is written")


_WHERE = 'such as "friction<0.3" or "hardening=none"; runs must meet all'


def _add_numbers(add: Add) -> None:
    one = add("diff", commands.diff)
    one.add_argument("first", type=_place, metavar="A", help="a study: a folder, a file or a URL")
    one.add_argument("second", type=_place, metavar="B", help="a study that may differ from it")
    _several(one, "--ignore", "NAME", "parameters that do not count, such as those of the mesh")
    one.add_argument("--field", help="the number of the runs that is drawn")
    one.add_argument("--out", type=_path, metavar="PNG", help="draw what differs")

    one = _of_study(add, "table", commands.table, _place, "DIR")
    kind = one.add_mutually_exclusive_group()
    kind.add_argument("--csv", action="store_true", help="with commas between; this is the default")
    kind.add_argument("--json", action="store_true", help="columns with units, rows as objects")
    one.add_argument("--columns", nargs="+", metavar="NAME", help="default: all")
    _several(one, "--where", "CONDITION", _WHERE)
    one.add_argument(
        "--sort", default="", metavar="NAME", help="by a column; --sort=-NAME: largest first"
    )
    one.add_argument("--out", type=_path, metavar="FILE", help="default: print it")

    one = _add_number(add, "best", commands.best, _place)
    _several(one, "--where", "CONDITION", _WHERE)
    one.add_argument("--lowest", action="store_true", help="the lowest numbers first")
    one.add_argument("--count", type=_integer(1, 10**6), default=10, help="default: %(default)s")

    one = _add_number(add, "predict", commands.predict, _store)
    one.add_argument("at", nargs="+", metavar="NAME=VALUE", help="each parameter that varies")
    one.add_argument("--by", choices=["cells", "gaussian"], help="default: cells, if it has any")
    one.add_argument("--within", type=float, metavar="E", help="largest error that is enough")
    one.add_argument(
        "--compute", action="store_true", help="compute the run there if the error is larger"
    )

    one = _add_number(add, "sensitivity", commands.sensitivity, _store)
    _several(one, "--select", "NAME=VALUE")
    one.add_argument(
        "--method", default="chaos",
        help="chaos (default); delta, pawn or rbd_fast, with the library SALib",
    )  # fmt: skip
    one.add_argument("--out", type=_path, metavar="PNG", help="draw indices, tornado and runs")


def _several(
    one: argparse.ArgumentParser, option: str, metavar: str, words: str | None = None
) -> None:
    one.add_argument(option, nargs="+", action="extend", default=[], metavar=metavar, help=words)


def _add_number(add: Add, name: str, command: Any, kind: Callable[[str], Any]) -> Any:
    """Return the parser of a command on a number of the runs of a study."""
    one = _of_study(add, name, command, kind, "DIR")
    one.add_argument("--of", required=True, metavar="NAME", help="a number of the runs")
    return one


def _add_access(add: Add) -> None:
    actions = add("keys", keys.keys).add_subparsers(required=True, metavar="ACTION")
    for act in (keys.add, keys.list_, keys.remove):
        name = act.__name__.strip("_")
        one = actions.add_parser(name, help=act.__doc__, description=act.__doc__)
        one.set_defaults(act=act)
        one.add_argument("--data", type=_store, metavar="DIR", help="of the service; default: out")
        if name != "list":
            one.add_argument("name", metavar="NAME")
        if name == "add":
            one.add_argument("--scope", choices=["read", "submit", "admin"], required=True)

    one = add("certificates", keys.certificates)
    one.add_argument("--out", type=_path, required=True, metavar="DIR")


def _add_remote(add: Add) -> None:
    for talk in (commands.submit, commands.status, commands.cancel, commands.fetch):
        name = talk.__name__
        one = add(name, commands.remote, talk=talk)
        one.add_argument("--url", default="http://127.0.0.1:8000")
        one.add_argument(
            "--api-key-file", type=_path, metavar="FILE",
            help="contains the API key (default: environment variable RESIDUA_API_KEY); as an "
            "argument the key would be visible to everybody on this machine",
        )  # fmt: skip
        if name == "submit":
            one.add_argument("study", type=_path, metavar="STUDY.toml")
        else:
            one.add_argument("id", metavar="ID|NAME", help="of the study")
        if name == "fetch":
            one.add_argument("--out", type=_path, metavar="FILE", help="default: ID.nc")


def _path(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError(f"{text!r}: must be the name of a file or a folder")
    if is_address(text):
        raise argparse.ArgumentTypeError("must be on this machine, not at an address")
    return Path(text)


def _store(text: str) -> Path:
    """Return the folder of a store, also of one at an address."""
    try:
        return directory_of(text) if text else _path(text)
    except (OSError, StudyError) as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _place(text: str) -> Path | str:
    """Return the path of a study, or its URL as it is: a path has no double slash."""
    return text if text.startswith(("http://", "https://")) else _store(text)


def _part(text: str) -> tuple[int, int]:
    number, sign, count = text.partition("/")
    if not (sign and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text!r}: must be I/N with 1 <= I <= N")
    return int(number), int(count)


def _integer(least: int, most: int) -> Callable[[str], int]:
    def checked(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            allowed = f"must be an integer >= {least} and <= {most}"
            raise argparse.ArgumentTypeError(f"{text!r}: {allowed}")
        return int(text)

    return checked
