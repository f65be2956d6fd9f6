"""Parts that studies and scene files name by a word, such as hardening rules and loads.

A part is a frozen dataclass whose fields are its parameters; a decorator on the class gives its
word. Studies, scene files and the documentation read words and parameters from these declarations.
A user's own files, named in the environment variable ``RESIDUA_PARTS``, add parts in the same way.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import os
import sys
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, cast

from solver.errors import ModelError

T = TypeVar("T")
C = TypeVar("C", bound=type[Any])

SETTING = "RESIDUA_PARTS"
"""Environment variable that names Python files with a user's own parts, joined as in ``PATH``."""


class Parts(Generic[T]):
    """The parts of one kind, by the word that names them.

    Parameters
    ----------
    kind : parameter that names one of them, such as ``hardening``
    alike : whether parts that share a parameter must declare it in the same way; false if each part
        has its own table in a scene file
    """

    def __init__(self, kind: str, *, alike: bool = True) -> None:
        self.kind = kind
        self._alike = alike
        self._known: dict[str, type[T]] = {}

    def word(self, word: str) -> Callable[[C], C]:
        """Return the decorator that gives a class its word.

        Raises
        ------
        ModelError
            if another class has the word, or declares one of its parameters differently
        """

        def named(part: C) -> C:
            before = self._known.get(word)
            if before is not None and not run_again(before, part):
                raise ModelError(self.kind, word, f"is the word of {before.__qualname__} already")
            self._known[word] = part
            if self._alike:
                self.parameters()  # raises if two parts declare one parameter differently
            return part

        return named

    def __iter__(self) -> Iterator[str]:
        """Iterate over the words."""
        return iter(self.all())

    def __getitem__(self, word: str) -> type[T]:
        """Return the class of a word or raise `ModelError`."""
        known = self.all()
        if word not in known:
            raise ModelError(self.kind, word, "must be one of " + ", ".join(known))
        return known[word]

    def all(self) -> Mapping[str, type[T]]:
        """Return word -> class, including those of the user's own files."""
        load_own_parts()
        return self._known

    def parameters(self) -> dict[str, tuple[Any, dataclasses.Field[Any]]]:
        """Return the parameters of all parts: name -> annotation and field.

        Raises
        ------
        ModelError
            if two parts declare a parameter with different type, range, default or meaning
        """
        found: dict[str, tuple[Any, dataclasses.Field[Any]]] = {}
        for word, part in self._known.items():
            for name, (hint, field) in declared(part).items():
                hint0, field0 = found.setdefault(name, (hint, field))
                if (hint0, field0.default, field0.metadata) != (
                    hint,
                    field.default,
                    field.metadata,
                ):
                    allowed = f"declares its parameter {name} differently from another part"
                    raise ModelError(self.kind, word, allowed)
        return found

    def fields(self, cls: C) -> C:
        """Decorate a class: annotate the parameter `kind` with all words, and add all parameters.

        Write it below ``@dataclass``, which makes fields of the annotations. The attribute
        ``PARTS`` of the class lists all kinds of parts whose parameters it has.

        Raises
        ------
        ModelError
            if a base class has a field of one of these names
        ImportError
            while a user's own file is running: its parts are not known yet
        """
        if _RUNNING:
            raise ImportError("it imports scenes, whose parameters include those of its parts")
        cls.__annotations__[self.kind] = Literal[tuple(self)]
        cast("Any", cls).PARTS = (*getattr(cls, "PARTS", ()), self)
        for name, (hint, field) in self.parameters().items():
            if name in getattr(cls, "__dataclass_fields__", {}):
                raise ModelError(self.kind, name, "is another parameter already: name it otherwise")
            cls.__annotations__[name] = hint
            own = dataclasses.field(default=field.default, metadata=field.metadata)
            setattr(cls, name, own)
        return cls

    def used(self, word: str) -> frozenset[str]:
        """Return the names of the parameters of a part."""
        return frozenset(declared(self[word]))

    def declared_by(self, word: str) -> dict[str, bool]:
        """Return the parameters of a part: name -> whether it must be given."""
        return {n: f.default is dataclasses.MISSING for n, (_, f) in declared(self[word]).items()}

    def needs(self) -> dict[str, dict[str, tuple[str, ...]]]:
        """Return for each parameter what it needs to have an effect: ``kind`` -> words."""
        return {
            name: {self.kind: tuple(word for word in self if name in self.used(word))}
            for name in self.parameters()
        }

    def made(self, word: str, values: Any) -> T:
        """Return the part of a word; its parameters are attributes of ``values``."""
        part = self[word]
        return part(**{name: getattr(values, name) for name in declared(part)})


Declared = Mapping[str, tuple[Any, dataclasses.Field[Any]]]


def declared(part: type[Any]) -> Declared:
    """Return the parameters of a part, in their order: name -> annotation and field."""
    return _declared(cast("Any", part))


@cache
def _declared(part: Any) -> Declared:
    hints = typing.get_type_hints(part, include_extras=True)
    return {f.name: (hints[f.name], f) for f in dataclasses.fields(part) if f.init}


def own_files() -> tuple[Path, ...]:
    """Return the user's own files that ``RESIDUA_PARTS`` names."""
    given = os.environ.get(SETTING, "")
    return tuple(Path(each).resolve() for each in given.split(os.pathsep) if each)


@cache
def load_own_parts() -> None:
    """Run the user's own files, once per process.

    Raises
    ------
    ModelError
        if a file cannot be read or run
    """
    for k, path in enumerate(own_files()):
        name = f"residua_parts_{k}_{path.stem}"
        if name in _RUNNING:
            continue
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None or not path.is_file():
            there = "" if path.is_file() else ", and there is no such file"
            raise ModelError(SETTING, str(path), f"must name Python files{there}")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        _RUNNING.append(name)
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            del sys.modules[name]
            raise ModelError(SETTING, str(path), f"must run: {error}") from error
        finally:
            _RUNNING.remove(name)


_RUNNING: list[str] = []
"""The user's own files that are running now."""


def run_again(one: Any, other: Any) -> bool:
    """Whether two objects have one definition, whose file ran both as script and as parts."""
    return (one.__qualname__, _file(one)) == (other.__qualname__, _file(other))


def _file(part: Any) -> str:
    """Return the file of a class or function; the module's name differs when it runs as script."""
    return str(getattr(sys.modules.get(part.__module__), "__file__", part.__module__))
