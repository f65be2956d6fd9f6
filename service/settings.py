"""What an operator may set, by argument or by an environment variable ``RESIDUA_…``."""

from __future__ import annotations

from pathlib import Path

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
    connections: int = Field(default=500, ge=1, description="most connections at a time")
    arrival_seconds: float = Field(
        default=20.0, gt=0, description="time in which a request, head and body, must arrive"
    )
    answer_seconds: float = Field(
        default=60.0, gt=0, description="time a client may take no part of its answer"
    )
    map_queue: int = Field(default=8, ge=0, description="pictures that may wait to be drawn")
    map_bytes: int = Field(default=32_000_000, ge=0, description="size of the pictures kept")
    attempts: int = Field(
        default=5, ge=1, description="starts of a study that bring no new run before it fails"
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
