"""What pyproject.toml cannot say: the package takes the published numbers along.

They are kept in ``data/``, where readers find them; ``residua compare`` needs them wherever it is
installed. A build copies them to ``studies/data/``.
"""

from __future__ import annotations

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

PATTERNS = ("data/reference/*.csv", "data/studies/*-table.toml")
"""Published numbers, and the studies whose cases they belong to."""


class BuildPy(build_py):
    """Build that copies the published numbers beside the modules."""

    def run(self) -> None:
        """Build the modules, then copy; an editable installation reads the checkout's own."""
        super().run()
        if self.editable_mode:
            return
        for source, target in self._published().items():
            self.mkpath(str(Path(target).parent))
            self.copy_file(source, target)

    def get_source_files(self) -> list[str]:
        """Return what a source distribution needs in order to be built."""
        return [*super().get_source_files(), *self._published()]

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Return the files that a build writes."""
        copied = [] if self.editable_mode else list(self._published().values())
        return [*super().get_outputs(include_bytecode), *copied]

    def _published(self) -> dict[str, str]:
        """Return source -> target of what is copied."""
        found = {
            str(path): str(Path(self.build_lib, "studies", path))
            for pattern in PATTERNS
            for path in sorted(Path().glob(pattern))
        }
        if not found:
            raise FileNotFoundError(f"no published numbers to build from: {', '.join(PATTERNS)}")
        return found


if __name__ == "__main__":
    setup(cmdclass={"build_py": BuildPy})
