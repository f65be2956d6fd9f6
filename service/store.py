"""The store as a service needs it: readable from the first moment on."""

from __future__ import annotations

from pathlib import Path

from studies import Store


def open_store(directory: Path) -> Store:
    """Return the store in ``directory`` with a catalogue that can be read.

    Readers cannot make a missing catalogue, nor undo what a killed writer left half done; opening
    it for writing does both.
    """
    store = Store(directory)
    store.catalogue.put(())
    return store
