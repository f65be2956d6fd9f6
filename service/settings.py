"""Settings of the service, by argument or by an environment variable ``RESIDUA_…``."""

from __future__ import annotations

from dataclasses import fields
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, FilePath, ValidationError
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from solver.files import LARGEST
from solver.memory import most_kept
from studies.errors import StudyError, form
from studies.execution.access import Access
from studies.execution.estimate import Bounds
from studies.execution.executor import Limits
from studies.scenes.refusals import mistakes_of
from studies.storage.blobs import directory_of


def _words(given: Any) -> Any:
    """Return the parts of a text that are separated by commas."""
    return [word.strip() for word in given.split(",")] if isinstance(given, str) else given


def _folder(given: Any) -> Any:
    """Return the whole path of a folder, since other processes work elsewhere, or of an address."""
    return directory_of(given).resolve() if isinstance(given, str | Path) else given


class Settings(BaseSettings):
    """Settings of one service process."""

    model_config = SettingsConfigDict(
        env_prefix="RESIDUA_", env_ignore_empty=True, frozen=True, extra="forbid"
    )

    data: Annotated[Path, BeforeValidator(_folder)] = Field(
        default=Path("out"),
        validate_default=True,
        description="directory of runs, studies and the queue; or an address, such as s3://bucket/x",
    )
    host: str = Field(default="127.0.0.1", description="where to listen")
    port: int = Field(default=8000, ge=0, le=65535, description="where to listen")
    require_keys: bool = Field(
        default=False, description="ask for API keys also where only this machine gets in"
    )
    allowed_hosts: Annotated[tuple[str, ...], NoDecode, BeforeValidator(_words)] = Field(
        default=(), description="names callers may use besides localhost and addresses; * for any"
    )
    forwarded_allow_ips: str | None = Field(
        default=None, description="proxies whose X-Forwarded-For and -Proto are believed"
    )
    root_path: str = Field(
        default="",
        pattern=form(r"^(/[\w.~-]+)*$", "must be a path such as /residua, or empty"),
        description="path that a proxy strips",
    )
    scheduler: str | None = Field(
        default=None, description="dask scheduler; without one each study starts its own workers"
    )
    scheduler_ca: FilePath | None = Field(
        default=None, description="certificate that a scheduler at tls:// must have, PEM"
    )
    scheduler_cert: FilePath | None = Field(
        default=None, description="certificate we show the scheduler, PEM"
    )
    scheduler_key: FilePath | None = Field(default=None, description="its key, PEM")
    workers: int | None = Field(
        default=None, ge=1, description="worker processes when there is no scheduler"
    )
    max_body_bytes: int = Field(default=1_000_000, ge=1, description="largest request body")
    max_scene_bytes: int = Field(
        default=20_000_000, ge=1, le=LARGEST, description="largest scene file with its meshes"
    )
    max_scenes_bytes: int = Field(
        default=10_000_000_000,
        ge=0,
        description="size of all posted scenes above which none is kept",
    )
    max_key_scenes_bytes: int = Field(
        default=2_000_000_000, ge=0, description="the same for the scenes of a key"
    )
    reader_seconds: float = Field(
        default=30.0,
        gt=0,
        description="processor time in a minute for what is read for a key, as much for what is "
        "computed, and as much for what is combined; also the longest of reading a scene [s]",
    )
    connections: int = Field(default=500, ge=1, description="most connections at a time")
    arrival_seconds: float = Field(
        default=20.0, gt=0, description="time in which a request, head and body, must arrive"
    )
    answer_seconds: float = Field(
        default=60.0, gt=0, description="time a client may take no part of its answer"
    )
    map_bytes: int = Field(default=32_000_000, ge=0, description="size of the pictures kept")
    attempts: int = Field(
        default=5, ge=1, description="starts of a study that bring no new run before it fails"
    )
    studies_at_once: int = Field(
        default=4, ge=1, description="studies computed at the same time, on shared workers"
    )
    max_queue: int = Field(default=1000, ge=1, description="most studies that may wait")
    idle_seconds: float = Field(
        default=10.0, ge=0, description="time without a study after which the workers are ended"
    )
    patience_seconds: float | None = Field(
        default=None, gt=0, description="time without a worker after which a study ends; none: wait"
    )
    stall_seconds: float | None = Field(
        default=900.0,
        gt=0,
        description="longest time without progress of a loading path, or without a word of a child",
    )
    path_seconds: float | None = Field(
        default=None, gt=0, description="longest time that a loading path may take"
    )
    worker_memory: str | None = Field(
        default=None, description="memory of a worker process of our own, such as 4GiB"
    )
    poll_seconds: float = Field(
        default=0.5, gt=0, description="how often the queue and the event streams look for news"
    )
    grace_seconds: float = Field(
        default=10.0, gt=0, description="time a study is given to stop before it is killed"
    )
    lock_seconds: float = Field(
        default=20.0, ge=0, description="time to wait for another service to leave the directory"
    )
    keep_days: float | None = Field(
        default=None, gt=0, description="days after its end at which a study is deleted"
    )
    keep_bytes: int | None = Field(
        default=None, ge=0, description="size of the data above which the oldest are deleted"
    )
    max_runs: int = Field(default=100_000, ge=1, description="most runs of a study")
    max_unknowns: int = Field(default=2_000_000, ge=1, description="most unknowns of a run")
    max_increments: int = Field(
        default=50_000, ge=1, description="most increments of a loading path"
    )
    max_cpu_seconds: float = Field(
        default=50_000.0, gt=0, description="most processor time a study is likely to take"
    )
    max_bytes: int = Field(
        default=50_000_000_000, ge=1, description="most bytes a study is likely to store"
    )
    log_format: Literal["plain", "json"] = Field(default="plain", description="form of the log")

    @property
    def limits(self) -> Limits:
        """Limits on the execution of a study."""
        return Limits(
            stall_seconds=self.stall_seconds,
            path_seconds=self.path_seconds,
            memory=self.worker_memory,
            patience=self.patience_seconds,
        )

    @property
    def bounds(self) -> Bounds:
        """Bounds on the cost of a study."""
        return Bounds(**{each.name: getattr(self, f"max_{each.name}") for each in fields(Bounds)})

    @property
    def outside_access(self) -> Access | None:
        """Access to the scheduler; None if the service starts its own workers."""
        if self.scheduler is None:
            return None
        files = {"ca": self.scheduler_ca, "cert": self.scheduler_cert, "key": self.scheduler_key}
        given = {name: str(path.resolve()) for name, path in files.items() if path}
        return Access(self.scheduler, **given)

    @property
    def keys_required(self) -> bool:
        """Whether callers need a key. It depends on the address of the service, not the caller's.

        Behind a proxy on this machine every caller has the address 127.0.0.1.
        """
        address = address_of(self.host)
        local = address.is_loopback if address else self.host == "localhost"
        return self.require_keys or not local


def chosen(**given: Any) -> Settings:
    """Return the settings: arguments that are not None, the rest from the environment.

    A `StudyError` or `ModelError` names the wrong variable.
    """
    try:
        settings = Settings(**{name: each for name, each in given.items() if each is not None})
    except OSError as error:
        raise StudyError("RESIDUA_SCHEDULER_CA", error.filename, f"{error.strerror}") from None
    except ValidationError as error:
        for each in error.errors():
            if isinstance(refused := each.get("ctx", {}).get("error"), StudyError):
                raise refused.renamed(lambda name: "RESIDUA_DATA") from None  # without a password
        found = StudyError.of([*mistakes_of(error, Settings).values()])
        raise found.renamed(lambda name: f"RESIDUA_{name}".upper()) from None
    for part in ("limits", "outside_access", "bounds"):
        getattr(settings, part)  # raises errors now, not when a study needs it
    most_kept()
    return settings


def address_of(host: str) -> IPv4Address | IPv6Address | None:
    """Return the address of a host that is given by a number; None for a name."""
    try:
        return ip_address(host)
    except ValueError:
        return None
