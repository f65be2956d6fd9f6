"""A table of runs as CSV, JSON and Parquet, written in pieces: it never stands whole in memory."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from studies.views.columns import or_none
from studies.views.table import Column

PIECE = 1000
"""Number of runs in a piece of text."""

GROUP = 20_000
"""Number of runs in a row group of Parquet."""

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""With these a text begins that a spreadsheet takes for a formula, and carries out."""

Columns = Sequence[Column]
Write = Callable[[Columns, np.ndarray], Iterator[bytes]]


class Form(NamedTuple):
    """A form of a table: the type of the answer, and what writes columns at the rows of runs."""

    media_type: str
    write: Write


def as_csv(columns: Columns, at: np.ndarray) -> Iterator[bytes]:
    """Yield a line with the names, and a line for each run; no value is an empty cell.

    Before a text that would be a formula stands an apostrophe: a spreadsheet then shows it as text.
    Numbers are as they are.

    References
    ----------
    OWASP, CSV Injection.
    """
    yield _lines([[each.name for each in columns]])
    for part in _parts(at, PIECE):
        yield _lines(zip(*(_cells(each, part) for each in columns), strict=True))


def as_json(columns: Columns, at: np.ndarray) -> Iterator[bytes]:
    """Yield an object: ``columns`` with name, meaning and unit, ``rows`` with an object a run.

    No value is null, and so is infinity, as the condition of a fit may be.
    """
    head = [{"name": each.name, "words": each.words, "unit": each.unit} for each in columns]
    yield f'{{"columns": {json.dumps(head)}, "rows": ['.encode()
    between = "\n"
    for part in _parts(at, PIECE):
        values = zip(*(_values(each, part) for each in columns), strict=True)
        names = [each.name for each in columns]
        finite = (map(or_none, row) for row in values)
        rows = (json.dumps(dict(zip(names, row, strict=True)), allow_nan=False) for row in finite)
        yield (between + ",\n".join(rows)).encode()
        between = ",\n"
    yield b"\n]}\n"


def as_parquet(columns: Columns, at: np.ndarray) -> Iterator[bytes]:
    """Yield a Parquet file; meaning and unit of a column are in its metadata, no value is null.

    Raises
    ------
    ModuleNotFoundError
        without pyarrow
    """
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.schema(
        pa.field(
            each.name,
            pa.float64() if each.number and not each.flags else pa.string(),
            metadata={"long_name": each.words, "units": each.unit},
        )
        for each in columns
    )
    pieces = _Pieces()
    with parquet.ParquetWriter(pa.PythonFile(pieces, "w"), schema) as file:
        for part in _parts(at, GROUP):
            arrays = [
                pa.array(_values(each, part), field.type)
                for each, field in zip(columns, schema, strict=True)
            ]
            file.write_table(pa.Table.from_arrays(arrays, schema=schema), row_group_size=GROUP)
            yield pieces.taken()
    yield pieces.taken()


FORMS = {
    "csv": Form("text/csv", as_csv),
    "json": Form("application/json", as_json),
    "parquet": Form("application/vnd.apache.parquet", as_parquet),
}
"""The forms by the ending of the table's name."""


class _Pieces(io.RawIOBase):
    """A file that hands over what was written to it."""

    def __init__(self) -> None:
        super().__init__()
        self._written = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, content: Any) -> int:
        self._written += content
        return len(content)

    def taken(self) -> bytes:
        """Return what was written since the last time."""
        found = bytes(self._written)
        self._written.clear()
        return found


def _parts(at: np.ndarray, size: int) -> Iterator[np.ndarray]:
    return (at[first : first + size] for first in range(0, len(at), size))


def _values(column: Column, at: np.ndarray) -> list[Any]:
    """Return numbers, words and texts; None where there is no value."""
    values: list[Any] = column.values[at].tolist()
    if not column.number:
        return values
    words = {float(code): word for code, word in column.flags.items()}
    return [None if math.isnan(each) else words.get(each, each) for each in values]


def _cells(column: Column, at: np.ndarray) -> list[str]:
    """Return the texts of cells: numbers with all their digits, nothing where there is no value."""
    values = _values(column, at)
    if column.number:
        write = "{:.0f}".format if column.whole else str
        return ["" if each is None else write(each) for each in values]
    texts = (f"'{each}" if each.startswith(FORMULA) else each for each in map(str, values))
    return [each.replace("\r", " ") for each in texts]  # the only end of a line not put in quotes


def _lines(rows: Any) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()
