"""The arrays of a mesh file, and their form as bytes that can be read without a library of meshes.

Such a library may have a fault. A service reads the file of a stranger once, in a process that can
do no harm, and stores the arrays.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray


class MeshData(NamedTuple):
    """The content of a mesh file.

    Attributes
    ----------
    points : positions (n_points, 2 or 3) [mm]
    cells : blocks of cells of one kind each: the kind, numbers of points (n_cells, n_nodes)
    sets : name -> number of a block -> its cells that belong to the set
    nodes : name -> numbers of the points that belong to the set
    """

    points: NDArray[np.float64]
    cells: list[tuple[str, NDArray[np.int64]]]
    sets: dict[str, dict[int, NDArray[np.int64]]]
    nodes: dict[str, NDArray[np.int64]]

    def packed(self) -> bytes:
        """Return a line of JSON, which tells what each array is and its shape, and the arrays."""
        every = list(self._named())
        head = json.dumps([[what, array.shape] for what, array in every])
        return b"\n".join([head.encode(), b"".join(array.tobytes() for _, array in every)])

    def _named(self) -> Iterator[tuple[list[Any], NDArray[Any]]]:
        yield ["points"], self.points.astype("<f8")
        for kind, cells in self.cells:
            yield ["cells", kind], cells.astype("<i8")
        for name, blocks in self.sets.items():
            for block, rows in blocks.items():
                yield ["set", name, block], rows.astype("<i8")
        for name, numbers in self.nodes.items():
            yield ["nodes", name], numbers.astype("<i8")

    @classmethod
    def unpacked(cls, data: bytes) -> Self:
        """Return what `packed` has made; raise `ValueError` for anything else."""
        head, _, rest = data.partition(b"\n")
        found, at = cls(np.zeros((0, 2)), [], {}, {}), 0
        try:
            for what, shape in json.loads(head):
                kind = np.dtype("<f8" if what == ["points"] else "<i8")
                array = np.frombuffer(rest, kind, math.prod(shape), at).reshape(shape)
                at += array.nbytes
                match what, array.ndim:
                    case ["points"], 2:
                        found = found._replace(points=array)
                    case ["cells", str(name)], 2:
                        found.cells.append((name, array))
                    case ["set", str(name), int(block)], 1:
                        found.sets.setdefault(name, {})[block] = array
                    case ["nodes", str(name)], 1:
                        found.nodes[name] = array
                    case _:
                        raise ValueError(f"{what} is no array of a mesh")
        except (TypeError, OverflowError, RecursionError) as error:
            raise ValueError(f"these are no arrays of a mesh: {error}") from None
        return found
