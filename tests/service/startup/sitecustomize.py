"""Registers the fake scene in every Python process that has this folder on its path.

Python imports ``sitecustomize`` by itself, so the service's children and their workers know the
scene although nobody tells them. None of them is less urgent than what started it: a test that
waits for a service would wait for all other tests too. A worker that waits gives a sign of life
each 5 s, as each 0.5 s, as dask has it, would take 2 % of a core.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import ClassVar


def _register(shipped: ModuleType) -> None:
    importlib.import_module("fake_scene").register(shipped)


def _rest(scheduler: ModuleType) -> None:
    scheduler.heartbeat_interval = lambda workers: 5.0


class Afterwards:
    """Import hook that changes modules when they have been loaded."""

    changes: ClassVar = {"solver.shipped": _register, "distributed.scheduler": _rest}

    @classmethod
    def find_spec(cls, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Find a module to change in the usual way, and wrap its loader."""
        if name not in cls.changes:
            return None
        change = cls.changes.pop(name)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def load_and_change(module: ModuleType) -> None:
            load(module)
            change(module)

        spec.loader.exec_module = load_and_change
        return spec


sys.meta_path.insert(0, Afterwards)
os.nice = lambda by: os.getpriority(os.PRIO_PROCESS, 0)
