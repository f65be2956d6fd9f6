"""What an operator may set, by argument or by an environment variable ``RESIDUA_…``."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


class Settings(BaseSettings):
    """Settings of one service process."""

    model_config = SettingsConfigDict(env_prefix="RESIDUA_", frozen=True, extra="forbid")

    data: Path = Field(
        default=Path("residua-data"), description="directory of runs, studies and the queue"
    )
    scheduler: str | None = Field(
        default=None, description="dask scheduler; without one each study starts its own workers"
    )
    workers: int | None = Field(
        default=None, ge=1, description="worker processes when there is no scheduler"
    )
    max_body_bytes: int = Field(default=1_000_000, ge=1, description="largest request body")
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
        default=900.0, gt=0, description="longest time without progress of a loading path"
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
    log_format: Literal["plain", "json"] = Field(default="plain", description="form of the log")

    def limits(self) -> dict[str, Any]:
        """Return the arguments of `studies.execution.limits.Limits`."""
        return {
            "stall_seconds": self.stall_seconds,
            "path_seconds": self.path_seconds,
            "memory": self.worker_memory,
            "patience": self.patience_seconds,
        }

    def outside_access(self) -> dict[str, Any] | None:
        """Return how the outside scheduler is reached; None when the workers are our own."""
        if self.scheduler is None:
            return None
        return {"address": self.scheduler, "ca": None, "cert": None, "key": None}
