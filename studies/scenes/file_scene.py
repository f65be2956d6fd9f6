"""A scene made from a file; what makes it is `studies.scenes.scene`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from solver.late import Late
from solver.scenes.scene import Scene

_file_scene = Late("studies.scenes.scene:file_scene")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileScene(Scene):
    """A scene made from a file.

    Attributes
    ----------
    description : the content of the file and its meshes, a `Description`, whose module loads scipy
    """

    description: Any

    @property
    def posted(self) -> bool:
        """Whether it is not of the package: studies call it by its content id."""
        return not self.description.shipped

    @property
    def id(self) -> str:
        """Content id of the file and its meshes."""
        return self.description.digest

    def __reduce__(self) -> tuple[Any, ...]:
        return _file_scene, (self.description,)
