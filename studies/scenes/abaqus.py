"""Meshes of Abaqus and CalculiX decks: nodes, plane elements, sets, surfaces, parts, instances.

A keyword that changes the mesh or its sets is read, or refused with its line. Other keywords are
passed over; reading ends at the first step. Names are case-insensitive and keep the spelling of
their first use.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from studies.scenes.meshdata import MeshData

Array = NDArray[np.float64]
Key = tuple[str, int]
"""Instance in capitals, "" outside of instances, and the number of a node or an element."""

_PLANE = re.compile(r"(CPEG?|CPS|CG?AX|DC2D|DCAX|STRI|D?S|M3D|SFM3D|R3D)([34689])[A-Z0-9]*")
_CELLS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
_LINE = re.compile(r"(?:T[23]D|R2D|RAX)([23])[A-Z]*|(?:B[23]|PIPE[23]|SAX|MAX|SFMAX)([12])[A-Z]*")
"""Elements along lines; the digit of the first is the number of nodes, of the others one less."""
_POINT = re.compile(
    r"MASS|ROTARYI|HEATCAP|SPRING[12A]|DASHPOT[12A]|CONN[23]D2|D?GAP\w*|JOINTC|DCOUP[23]D|IT[ST]\w+|D"
)
"""Elements without an extent: masses, springs, connectors, and fluid networks of CalculiX."""
_READ = "plane elements such as CPS4, CPE8R, CAX6 and S4, and elements along lines such as T2D2"
_LISTED = "is not read: write the deck with all nodes and elements"
_REFUSED = {
    **dict.fromkeys(("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY"), _LISTED),
    **dict.fromkeys(("SYMMETRICMODELGENERATION", "REFINEMESH", "IMPERFECTION", "ADJUST"), _LISTED),
    **dict.fromkeys(("IMPORT", "IMPORTNSET", "IMPORTELSET", "IMPORTSURFACE"), _LISTED),
    "INCLUDE": "is not read: put the lines of the other file in its place",
    "SYSTEM": "is not read: give coordinates in the global system",
}
_PARAMETERS = {
    "NODE": {"NSET", "SYSTEM"},
    "ELEMENT": {"TYPE", "ELSET"},
    "NSET": {"NSET", "ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "ELSET": {"ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "SURFACE": {"NAME", "TYPE", "INTERNAL", "TRIM", "REGIONTYPE", "FILLETRADIUS", "SCALETHICK"},
    "PART": {"NAME"},
    "INSTANCE": {"NAME", "PART"},
}


class _Block(NamedTuple):
    """A keyword with its line, its parameters, and its data: line and fields."""

    line: int
    keyword: str
    given: dict[str, str]
    data: list[tuple[int, list[str]]]


_Members = dict[tuple[str, int | range, str], int]
"""Instance, a number, or a range of numbers of which some may not exist, and in a surface the label
of an edge, "" for all edges on the outside -> the line. No member is there twice: sets of sets that
repeat one another would grow without bound."""


@dataclass(slots=True)
class _Set:
    """A set: its name, whether the deck alone uses it, and its members."""

    name: str
    internal: bool
    members: _Members = field(default_factory=dict)


def read_deck(text: str) -> MeshData:
    """Return the mesh of a deck, with its sets and surfaces.

    A set of a part is called `SET` and `INSTANCE.SET`; the first name is left out if the assembly
    has such a set. The elements of an instance are a set of its name.

    Raises
    ------
    ValueError
        with the line that is not understood
    """
    deck = _Deck()
    deck.read(_blocks(text))
    return deck.mesh()


def _refuse(line: int, reason: str) -> NoReturn:
    raise ValueError(f"line {line}: {reason}")


def _blocks(text: str) -> Iterator[_Block]:
    """Return the keywords of a deck up to its first step."""
    block, going_on = None, False
    for line, each in enumerate(text.splitlines(), start=1):
        row = each.strip()
        if not row or row.startswith("**"):
            continue
        if row.startswith("*"):
            if block is not None:
                yield block
            keyword, _, row = row.partition(",")
            block = _Block(line, re.sub(r"[*\s]", "", keyword).upper(), {}, [])
            if block.keyword == "STEP":
                return
        elif block is None:
            _refuse(line, f"{row[:20]!r} has no keyword before it")
        elif not going_on:
            block.data.append((line, [text.strip() for text in row.split(",")]))
            continue
        going_on = each.rstrip().endswith(",")
        for parameter in re.findall(r'(?:[^,"]|"[^"]*")+', row):
            key, _, value = parameter.partition("=")
            block.given[re.sub(r"\s", "", key).upper()] = _bare(value)
    if block is not None:
        yield block


def _bare(text: str) -> str:
    return text.strip().strip('"')


def _number(line: int, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        _refuse(line, f"{text!r} is not a whole number")


def _numbers(line: int, fields: list[str], count: int) -> list[float]:
    """Return the first fields as numbers; empty and absent ones are 0."""
    try:
        found = [float(each.upper().replace("D", "E") or 0) for each in fields[:count]]
    except ValueError as error:
        _refuse(line, str(error))
    return found + [0.0] * (count - len(found))


class _Deck:
    """What was read of a deck so far.

    Parts are kept as their keywords, which are read again for each instance.
    """

    def __init__(self) -> None:
        self.nodes: dict[Key, list[float]] = {}
        self.elements: dict[Key, tuple[str, list[Key], int]] = {}
        self.sets: dict[str, dict[tuple[str, str], _Set]] = {
            kind: {} for kind in ("NSET", "ELSET", "SURFACE", "NODE SURFACE")
        }
        self.parts: dict[str, tuple[str, list[_Block]]] = {}
        self.instances: dict[str, str] = {}
        self.instance = ""
        self.take = {
            "NODE": self._nodes,
            "ELEMENT": self._elements,
            "NSET": self._set,
            "ELSET": self._set,
            "SURFACE": self._surface,
        }

    def read(self, blocks: Iterator[_Block]) -> None:
        for block in blocks:
            self._check(block)
            if block.keyword == "PART":
                name = self._given(block, "NAME")
                self.parts[name.upper()] = name, list(self._until(blocks, block, "ENDPART"))
            elif block.keyword == "INSTANCE":
                part = self._given(block, "PART")
                if part.upper() not in self.parts:
                    _refuse(block.line, f"there is no part {part}")
                own = self._until(blocks, block, "ENDINSTANCE")
                each = [*self.parts[part.upper()][1], *own]
                self._place(self._given(block, "NAME"), each, _motion(block))
            else:
                self._read(block)
        if not self.instances:
            for name, each in self.parts.values():
                self._place(name, each, None)

    def _until(self, blocks: Iterator[_Block], first: _Block, end: str) -> Iterator[_Block]:
        for block in blocks:
            if block.keyword == end:
                return
            self._check(block)
            yield block
        _refuse(first.line, f"*{first.keyword} has no end")

    def _check(self, block: _Block) -> None:
        if block.keyword in _REFUSED:
            _refuse(block.line, f"*{block.keyword} {_REFUSED[block.keyword]}")
        allowed = _PARAMETERS.get(block.keyword)
        for each in block.given.keys() - (allowed or block.given.keys()):
            _refuse(block.line, f"the parameter {each} of *{block.keyword} is not read")

    def _given(self, block: _Block, parameter: str) -> str:
        if not block.given.get(parameter):
            _refuse(block.line, f"*{block.keyword} needs {parameter}=")
        return block.given[parameter]

    def _place(
        self, name: str, blocks: list[_Block], move: Callable[[Array], Array] | None
    ) -> None:
        """Read the keywords of a part as those of an instance, and move its nodes."""
        self.instance = name.upper()
        self.instances[self.instance] = name
        for block in blocks:
            self._read(block)
        own = [key for key in self.nodes if key[0] == self.instance]
        if move and own:
            moved = move(np.array([self.nodes[key] for key in own]))
            self.nodes.update(zip(own, moved.tolist(), strict=True))
        self.instance = ""

    def _read(self, block: _Block) -> None:
        if block.keyword in self.take:
            self.take[block.keyword](block)

    def _nodes(self, block: _Block) -> None:
        if block.given.get("SYSTEM", "R").upper() != "R":
            _refuse(block.line, f"SYSTEM {_REFUSED['SYSTEM']}")
        members = self._of("NSET", block, block.given.get("NSET"))
        for line, fields in block.data:
            key = self.instance, _number(line, fields[0])
            x = _numbers(line, fields[1:], 3)
            if self.nodes.setdefault(key, x) != x:
                _refuse(line, f"node {key[1]} has other coordinates before")
            members[*key, ""] = line

    def _elements(self, block: _Block) -> None:
        kind = self._given(block, "TYPE").upper()
        count = _count(kind)
        if count is None:
            _refuse(block.line, f"elements {kind} are not read, but {_READ}")
        members = self._of("ELSET", block, block.given.get("ELSET"))
        found: list[tuple[int, str]] = []
        for line, fields in block.data:
            found += [(line, each) for each in (fields[:-1] if not fields[-1] else fields)]
            if len(found) <= count and line != block.data[-1][0]:
                continue  # the rest is on the next line
            (first, number), *nodes = found
            if count and len(nodes) != count:
                _refuse(first, f"an element {kind} has {count} nodes, not {len(nodes)}")
            key = self.instance, _number(first, number)
            if key in self.elements:
                _refuse(first, f"element {number} is there before")
            ends = [self._key(k, self.instance, each) for k, each in nodes[:count]]
            self.elements[key] = kind, ends, first
            members[*key, ""] = first
            found = []

    def _of(self, kind: str, block: _Block, name: str | None) -> _Members:
        """Return the members of a set, to which more may be added; without a name some apart."""
        if not name:
            return {}
        new = _Set(name, "INTERNAL" in block.given)
        return self.sets[kind].setdefault((self.instance, name.upper()), new).members

    def _key(self, line: int, instance: str, text: str) -> Key:
        """Return the node or element of `NUMBER` or `INSTANCE.NUMBER`."""
        before, _, number = text.rpartition(".")
        return _bare(before).upper() or instance, _number(line, number)

    def _members(self, kind: str, line: int, instance: str, text: str) -> _Members:
        """Return a node or an element, or the members of a set that is there already."""
        before, _, name = text.upper().rpartition(".")
        for key in ((instance, _bare(text).upper()), (_bare(before) or instance, _bare(name))):
            if key in self.sets[kind]:
                return dict(self.sets[kind][key].members)
        if name.isdigit():
            return {(*self._key(line, instance, text), ""): line}
        _refuse(line, f"there is no {kind} {text} before")

    def _set(self, block: _Block) -> None:
        kind = block.keyword
        members = self._of(kind, block, self._given(block, kind))
        instance = block.given.get("INSTANCE", "").upper() or self.instance
        if instance and instance not in self.instances:
            _refuse(block.line, f"there is no instance {block.given['INSTANCE']}")
        if kind == "NSET" and "ELSET" in block.given:
            of = self._members("ELSET", block.line, instance, block.given["ELSET"])
            for key in _keys(of, self.elements, "element"):
                members |= {(*node, ""): block.line for node in self.elements[key][1]}
        for line, fields in block.data:
            each = [text for text in fields if text]
            if "GENERATE" not in block.given:
                for text in each:
                    members |= self._members(kind, line, instance, text)
                continue
            first, last, step = [*(_number(line, text) for text in each), 1, 1, 1][:3]
            if not 2 <= len(each) <= 3 or step < 1:
                _refuse(line, "must have a first and a last number, and a step >= 1")
            members[instance, range(first, last + 1, step), ""] = line

    def _surface(self, block: _Block) -> None:
        kind = block.given.get("TYPE", "ELEMENT").upper()
        if kind not in ("ELEMENT", "NODE"):
            return  # an analytical surface
        on_nodes = kind == "NODE"
        surface, other = ("SURFACE", "NODE SURFACE")[:: -1 if on_nodes else 1]
        members = self._of(surface, block, name := self._given(block, "NAME"))
        if (self.instance, name.upper()) in self.sets[other]:
            _refuse(block.line, f"the surface {name} has both edges and nodes")
        for line, (one, *rest) in block.data:
            label = rest[0].upper() if rest and not on_nodes else ""
            of = self._members("NSET" if on_nodes else "ELSET", line, self.instance, one)
            members |= {(instance, numbers, label): line for instance, numbers, _ in of}

    def mesh(self) -> MeshData:
        """Return the mesh of what was read."""
        index = {key: k for k, key in enumerate(self.nodes)}
        cells: dict[str, list[list[int]]] = {}
        place: dict[Key, tuple[str, int]] = {}
        for key, (kind, ends, line) in self.elements.items():
            for end in ends:
                if end not in index:
                    _refuse(line, f"node {_spelt(end)} does not exist")
            if ends:
                plane = _PLANE.fullmatch(kind)
                shape = _CELLS[len(ends)] if plane else "line"
                rows = cells.setdefault(shape, [])
                place[key] = shape, len(rows)
                rows.append([index[end] for end in (ends if plane else ends[:: len(ends) - 1])])
        blocks = [(shape, np.array(rows)) for shape, rows in cells.items()]
        number = {shape: k for k, shape in enumerate(cells)}
        sets: dict[str, dict[int, list[int]]] = {}
        for name, members in self._named("ELSET").items():
            for key in _keys(members, self.elements, "element"):
                if key in place:
                    shape, row = place[key]
                    sets.setdefault(name, {}).setdefault(number[shape], []).append(row)
        own = set(sets)
        for instance, name in self.instances.items():
            for key, (shape, row) in place.items():
                if key[0] == instance and name not in own:
                    sets.setdefault(name, {}).setdefault(number[shape], []).append(row)
        for name, members in self._named("SURFACE").items():
            if any(blocks[block][0].startswith("line") for block in sets.get(name, ())):
                _refuse(next(iter(members.values())), f"a surface and a set are both called {name}")
            edges = [[index[end] for end in edge] for edge in self._edges(members)]
            if edges:
                sets.setdefault(name, {})[len(blocks)] = list(range(len(edges)))
                blocks.append(("line", np.array(edges)))
        nodes: dict[str, NDArray[np.int64]] = {}
        for kind in ("NSET", "NODE SURFACE"):
            for name, members in self._named(kind).items():
                found = {index[key] for key in _keys(members, self.nodes, "node")}
                new = np.array(sorted(found), dtype=np.int64)
                if not np.array_equal(nodes.setdefault(name, new), new):
                    line = next(iter(members.values()), 0)
                    _refuse(line, f"a surface has other nodes than the set {name}")
        return MeshData(
            np.array(list(self.nodes.values()), dtype=float).reshape(-1, 3),
            blocks,
            {
                name: {block: np.unique(rows) for block, rows in own.items()}
                for name, own in sets.items()
            },
            nodes,
        )

    def _named(self, kind: str) -> dict[str, _Members]:
        """Return the sets of a kind by their names; see `read_deck`."""
        sets = self.sets[kind]
        found: dict[str, _Members] = {}
        plain: dict[str, str] = {}
        for (instance, key), one in sets.items():
            names = [f"{self.instances[instance]}.{one.name}"] if instance else []
            if not instance or ("", key) not in sets:
                names.append(plain.setdefault(key, one.name))
            for name in names if not one.internal else ():
                found.setdefault(name, {}).update(one.members)
        return found

    def _edges(self, members: _Members) -> Iterator[tuple[Key, Key]]:
        """Return the ends of the edges of a surface."""
        for (instance, numbers, label), line in members.items():
            for key in _keys({(instance, numbers, ""): line}, self.elements, "element"):
                kind, ends, _ = self.elements[key]
                solid = _PLANE.fullmatch(kind)
                if not ends:
                    _refuse(line, f"element {_spelt(key)} is {kind}, which has no edges")
                if not solid:  # it is an edge itself
                    yield ends[0], ends[-1]
                    continue
                edges = _around(ends)
                letter = "S" if solid[1][0] in "CD" and solid[1] != "DS" else "E"
                if not label:
                    yield from (edge for edge in edges if self._elements_at[frozenset(edge)] == 1)
                elif label in (known := [f"{letter}{k + 1}" for k in range(len(edges))]):
                    yield edges[known.index(label)]
                elif letter == "S" or label not in ("SPOS", "SNEG"):
                    _refuse(line, f"{label} must be an edge of a {kind}: {', '.join(known)}")

    @cached_property
    def _elements_at(self) -> Counter[frozenset[Key]]:
        """Number of plane elements at each edge."""
        plane = (ends for kind, ends, _ in self.elements.values() if _PLANE.fullmatch(kind))
        return Counter(frozenset(edge) for ends in plane for edge in _around(ends))


def _count(kind: str) -> int | None:
    """Return the number of nodes of elements, 0 for those without an extent; None is unknown."""
    if found := _PLANE.fullmatch(kind):
        return int(found[2])
    if found := _LINE.fullmatch(kind):
        return int(found[1] or int(found[2]) + 1)
    return 0 if _POINT.fullmatch(kind) else None


def _around(ends: list[Key]) -> list[tuple[Key, Key]]:
    """Return the ends of the edges of a plane element, from those of its first two corners on."""
    corners = ends[: 3 if len(ends) in (3, 6) else 4]
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def _spelt(key: Key) -> str:
    return ".".join(str(each) for each in key if each != "")


def _keys(members: _Members, known: Mapping[Key, object], what: str) -> Iterator[Key]:
    """Return the nodes or elements that members are; raise for one that does not exist."""
    for (instance, numbers, _), line in members.items():
        if isinstance(numbers, int):
            if (instance, numbers) not in known:
                _refuse(line, f"{what} {_spelt((instance, numbers))} does not exist")
            yield instance, numbers
        elif len(numbers) <= len(known):
            yield from (key for k in numbers if (key := (instance, k)) in known)
        else:
            yield from (key for key in known if key[0] == instance and key[1] in numbers)


def _motion(block: _Block) -> Callable[[Array], Array]:
    """Return how an instance is moved: a translation, then a rotation about a line from a to b."""
    lines = [line for line, _ in block.data]
    for (line, fields), count in zip(block.data, (3, 7), strict=False):
        if any(fields[count:]):
            _refuse(line, f"must have at most {count} numbers: a translation, then a rotation")
    shift, turn = [
        _numbers(*row, count)
        for row, count in zip([*block.data, *[(0, [])] * 2], (3, 7), strict=False)
    ]
    if len(lines) > 2:
        _refuse(lines[2], "an instance has at most two lines: a translation and a rotation")
    a, b, angle = np.array(turn[:3]), np.array(turn[3:6]), np.radians(turn[6])
    axis = (b - a) / (np.linalg.norm(b - a) or 1.0)

    def move(x: Array) -> Array:
        r = x + shift - a
        along = np.outer(r @ axis, axis)
        return a + along + (r - along) * np.cos(angle) + np.cross(axis, r) * np.sin(angle)

    return move
