"""The command ``residua``."""

from __future__ import annotations

import argparse
import importlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from studies.errors import GridLost, StoreBusy, StudyError
from studies.study import Study

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
SHOWN = 100
"""Most runs that `run` prints; `show` prints all."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    0: all went well. 1: some runs failed, or the machinery did. 2: bad input. 130: interrupted.
    """
    options = _parser().parse_args(arguments)
    try:
        return options.command(options)
    except StudyError as error:
        return _complain(error, BAD_INPUT)
    except (StoreBusy, GridLost) as error:
        return _complain(error, FAILED)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has left; say no more
        return OK
    except OSError as error:
        return _complain(error, FAILED)


def run(options: argparse.Namespace) -> int:
    """Compute a study, print its runs and draw one of them."""
    from studies.progress import Progress
    from studies.reading import open_study
    from studies.run import run_study
    from studies.store import Store
    from studies.tables import runs_table

    study = Study.from_toml(options.study)
    progress = Progress(study)
    with _interruption() as interrupted:
        outcome = run_study(
            study,
            Store(options.out),
            workers=options.workers,
            scheduler=options.scheduler,
            resume=options.resume,
            on_event=progress,
            should_stop=lambda: bool(interrupted),
        )
    progress.close()
    with open_study(outcome.dataset) as dataset:
        if study.size <= SHOWN:
            print(runs_table(dataset))
        warned = _warned(dataset)
        picture = _picture(dataset, outcome.dataset.with_name("residual_stress_xx.png"))
    for run_id, status, message in outcome.failed:
        print(f"{status}  runs/{run_id}.nc  {message}", file=sys.stderr)
    counts = ", ".join(f"{number} {status}" for status, number in outcome.counts.items())
    computed = f"{len(outcome.computed)} computed in {outcome.wall_seconds:.0f} s"
    print(f"\n{study.name}: {study.size} runs ({counts}{warned}), {computed}")
    for written in (outcome.dataset, *picture):
        print(f"wrote {written}")
    if outcome.stopped:
        return INTERRUPTED
    return OK if outcome.ok else FAILED


def scenes(options: argparse.Namespace) -> int:
    """List the scenes, or the parameters of one."""
    from studies.tables import scene_table, scenes_table

    print(scene_table(options.name) if options.name else scenes_table())
    return OK


def show(options: argparse.Namespace) -> int:
    """Print what is known of a run, a study or all studies of a directory."""
    from studies.reading import find_datasets, open_netcdf
    from studies.tables import run_details, runs_table

    for path in find_datasets(options.path):
        with open_netcdf(path) as dataset:
            single = dataset["status"].size == 1
            print(f"{dataset.attrs['title']}  ({path})\n")
            print(run_details(dataset) if single else runs_table(dataset), end="\n\n")
    return OK


def plot(options: argparse.Namespace) -> int:
    """Draw a field of one run."""
    from studies.plots import figure
    from studies.reading import one_run, open_study

    selection = dict(_assignment(text) for text in options.select)
    with open_study(options.path) as dataset:
        run = one_run(dataset, selection)
        _save(figure(run, options.field, options.component, options.zoom), options.out)
    print(f"wrote {options.out}")
    return OK


def serve(options: argparse.Namespace) -> int:
    """Start the HTTP service."""
    # By name, since studies must work where the service is not installed.
    service: Any = importlib.import_module("service.app")
    service.serve(options.host, options.port, options.data, options.scheduler)
    return OK


def remote(options: argparse.Namespace) -> int:
    """Talk to a running service."""
    import httpx

    from studies.client import Refused, Service

    try:
        service = Service(options.url)
        print(options.talk(service, options))
    except Refused as error:
        return _complain(error, BAD_INPUT)
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        return _complain(f"{options.url}: {error}", FAILED)
    return OK


def _submit(service: Any, options: argparse.Namespace) -> str:
    return str(service.submit(options.study)["id"])


def _status(service: Any, options: argparse.Namespace) -> str:
    state = service.status(options.id)
    return f"{state['status']}  {state['progress']:g} %"


def _cancel(service: Any, options: argparse.Namespace) -> str:
    service.cancel(options.id)
    return f"cancelled {options.id}"


def _fetch(service: Any, options: argparse.Namespace) -> str:
    target = options.out or Path(f"{options.id}.nc")
    service.fetch(options.id, target)
    return f"wrote {target}"


@contextmanager
def _interruption() -> Iterator[list[int]]:
    """Give a list that is empty until Ctrl-C; a second Ctrl-C does not wait."""
    received: list[int] = []

    def receive(number: int, frame: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)
        print("\nstopping; what is finished is kept", file=sys.stderr)

    before = signal.signal(signal.SIGINT, receive)
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, before)


def _warned(dataset: Any) -> str:
    """Return how many runs succeeded with a warning, which their details show."""
    from studies.dataset import STATUSES

    warned = (dataset["status"] == STATUSES.index("ok")) & (dataset["message"] != "")
    return f"; {int(warned.sum())} with a warning" if warned.any() else ""


def _picture(dataset: Any, path: Path) -> list[Path]:
    """Draw the residual stress of the run with most of it; nothing when no run succeeded."""
    from studies.plots import map_figure
    from studies.reading import one_run

    try:
        drawn = map_figure(one_run(dataset), "residual_stress", "xx")
    except StudyError:
        return []
    _save(drawn, path)
    return [path]


def _save(drawn: Any, path: Path) -> None:
    """Write a figure in the format that the name of the file asks for."""
    from studies.store import appearing

    kinds = drawn.canvas.get_supported_filetypes()
    kind = path.suffix.removeprefix(".").lower() or "png"
    if kind not in kinds:
        raise StudyError("--out", str(path), f"must end in one of {', '.join(sorted(kinds))}")
    try:
        with appearing(path) as part:
            drawn.savefig(part, format=kind)
    except OSError as error:
        raise StudyError("--out", str(path), f"cannot be written: {error.strerror}") from None


def _assignment(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign:
        raise StudyError("--select", text, "must be AXIS=VALUE")
    return name.strip(), value.strip()


def _complain(reason: object, status: int) -> int:
    print(f"residua: {reason}", file=sys.stderr)
    return status


def _integer(least: int, most: int) -> Callable[[str], int]:
    def checked(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            allowed = f"must be an integer >= {least} and <= {most}"
            raise argparse.ArgumentTypeError(f"{text!r}: {allowed}")
        return int(text)

    return checked


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="residua", description="Residual stress after elastic-plastic contact."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, command: Any, **defaults: Any) -> argparse.ArgumentParser:
        text = (defaults.get("talk") or command).__doc__ or f"{name} a study on a running service"
        one = commands.add_parser(name, help=text, description=text)
        one.set_defaults(command=command, **defaults)
        return one

    one = add("run", run)
    one.add_argument("study", type=Path, metavar="STUDY.toml")
    one.add_argument("--out", type=Path, default=Path("out"), metavar="DIR")
    one.add_argument("--workers", type=_integer(1, 1024), help="processes (default: one a core)")
    one.add_argument("--scheduler", metavar="ADDRESS", help="use a running dask scheduler")
    one.add_argument("--resume", action="store_true", help="do not try failed runs again")

    one = add("scenes", scenes)
    one.add_argument("name", nargs="?")

    one = add("show", show)
    one.add_argument("path", type=Path, metavar="DIR|RUN")

    one = add("plot", plot)
    one.add_argument("path", type=Path, metavar="RUN|DIR")
    one.add_argument("--select", nargs="+", default=[], metavar="AXIS=VALUE")
    one.add_argument("--field", default="residual_stress")
    one.add_argument("--component")
    one.add_argument("--zoom", type=float, metavar="MM", help="only this close to the edge")
    one.add_argument("--out", type=Path, required=True, metavar="PNG")

    one = add("serve", serve)
    one.add_argument("--host", default="127.0.0.1")
    one.add_argument("--port", type=_integer(0, 65535), default=8000)
    one.add_argument("--data", type=Path, default=Path("out"), metavar="DIR")
    one.add_argument("--scheduler", metavar="ADDRESS", help="use a running dask scheduler")

    for name, talk in {
        "submit": _submit, "status": _status, "cancel": _cancel, "fetch": _fetch
    }.items():  # fmt: skip
        one = add(name, remote, talk=talk)
        one.add_argument("--url", default="http://127.0.0.1:8000")
        if name == "submit":
            one.add_argument("study", type=Path, metavar="STUDY.toml")
        else:
            one.add_argument("id")
        if name == "fetch":
            one.add_argument("--out", type=Path, metavar="FILE")
    return parser


if __name__ == "__main__":
    sys.exit(main())
