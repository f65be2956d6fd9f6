"""What passes over a track, as nodal forces that may depend on the shape of its surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Loading:
    """A load on a track.

    Attributes
    ----------
    force : (n,) nodal forces [N]
    along : its change (n,) for a change of the forces that stand for plastic strain (n,)
    """

    force: Array
    along: Callable[[Array], Array]


class Load(Protocol):
    """Something that passes over a track along +x."""

    def on(self, flow: Array) -> Loading:
        """Return the load on a track with the forces (n,) that stand for plastic strain."""


@dataclass(frozen=True, slots=True)
class Given:
    """Nodal forces (n,) that depend on nothing [N]."""

    force: Array

    def on(self, flow: Array) -> Loading:
        """See `Load`."""
        del flow
        return Loading(self.force, np.zeros_like)
