"""Profiles of residual stress below the middle, gathered from data sets by case and refinement."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.signal import find_peaks

from solver.scenes import Scene
from studies.definition.vocabulary import OK
from studies.errors import StudyError
from studies.scenes.registry import scene_named, scene_of
from studies.views.comparison.problem import (
    SAME,
    Parameters,
    differences,
    other_problem,
    run_parameters,
    told,
)
from studies.views.comparison.reference import STRAIN, Published
from studies.views.comparison.refinement import sizes_of
from studies.views.picking import one_run, select, sweep_axes, sweep_coordinates
from studies.views.reading import find_datasets, open_netcdf

CASE = "case"
"""Dimension whose labels are those of the published cases."""

Key = tuple[str, int]
"""Case and number of the pass."""

Level = tuple[float, ...]
"""Sizes of a run, in the order of `sizes_of` of its scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """What was left below the middle of the contact or the track, after a pass.

    Attributes
    ----------
    depth : ``(n,)`` [mm]
    values : component -> ``(n,)``, residual stress [MPa] or plastic strain
    parameters : those of the run
    """

    depth: np.ndarray
    values: Mapping[str, np.ndarray]
    parameters: Parameters

    def agrees_with(self, other: Profile) -> bool:
        """Tell whether both are the same but for rounding."""
        return self.depth.shape == other.depth.shape and all(
            np.allclose(
                mine, other.values[name], SAME, SAME * np.nanmax(np.abs(mine)), equal_nan=True
            )
            for name, mine in self.values.items()
        )

    def feature(self, published: Published) -> tuple[float, float]:
        """Return value and depth of a feature; NaN where the profile has no such feature.

        A local maximum has lower values on both sides within the depths searched; of several,
        the most prominent one is taken.
        """
        if published.component not in self.values:
            return np.nan, np.nan
        values = self.values[published.component]
        bottom = np.inf if published.bottom is None else published.bottom
        there = np.flatnonzero((self.depth >= published.top) & (self.depth <= bottom))
        there = there[np.isfinite(values[there])]
        if published.quantity == "local_maximum":
            peaks, properties = find_peaks(values[there], prominence=0.0)
            there = there[peaks[np.argsort(properties["prominences"])]]
        if not there.size:
            return np.nan, np.nan
        chosen = {
            "surface": 0,
            "minimum": np.argmin(values[there]),
            "maximum": np.argmax(values[there]),
            "local_maximum": -1,
        }
        at = there[chosen[published.quantity]]
        return float(values[at]), float(self.depth[at])


@dataclass(frozen=True, slots=True, kw_only=True)
class Computed:
    """The profiles of some data sets.

    Attributes
    ----------
    scene : their scene
    axes : names of the sizes that refine, as `sizes_of` the scene names them
    profiles : case and pass -> level -> profile, levels from coarse to fine
    """

    scene: str
    axes: tuple[str, ...]
    profiles: Mapping[Key, Mapping[Level, Profile]]

    @property
    def levels(self) -> list[Level]:
        """Every level of any case, from coarse to fine."""
        return sorted({level for each in self.profiles.values() for level in each}, reverse=True)


def read_profiles(paths: Sequence[Path], selection: Mapping[str, str]) -> Computed:
    """Read the profiles below the middle from data sets with cases.

    Parameters
    ----------
    paths : data sets, studies or output directories; data sets without cases are left out
    selection : axis -> wanted value

    Raises
    ------
    StudyError
        when a path holds no cases, no run succeeded, scenes differ, or runs of one case differ
        in more than refinement
    """
    profiles: dict[Key, dict[Level, Profile]] = defaultdict(dict)
    scenes: set[str] = set()
    for path in paths:
        found = False
        for file in find_datasets(path):
            with open_netcdf(file) as dataset:
                if not {CASE, "residual_profile"} <= dataset.variables.keys():
                    continue
                found = True
                scene = scene_of(dataset.attrs)
                scenes.add(scene.name)
                for key, level, profile in _profiles(select(dataset, selection)):
                    known = profiles[key]
                    if conflict := _conflict(scene, known, key, level, profile):
                        raise StudyError("path", str(path), _advised(dataset, *conflict))
                    known.setdefault(level, profile)
        if not found:
            allowed = f"must hold residual profiles of cases: a study with an axis `{CASE}`"
            raise StudyError("path", str(path), allowed)
    if len(scenes) > 1:
        raise StudyError("path", ", ".join(map(str, paths)), f"must be of one scene, not {scenes}")
    if not profiles:
        raise StudyError("path", ", ".join(map(str, paths)), "must hold a run that succeeded")
    name = scenes.pop()
    axes = tuple(size.name for size in sizes_of(scene_named(name)))
    ordered = {key: dict(sorted(each.items(), reverse=True)) for key, each in profiles.items()}
    return Computed(scene=name, axes=axes, profiles=ordered)


def _profiles(dataset: xr.Dataset) -> Iterator[tuple[Key, Level, Profile]]:
    """Yield the profiles of every successful run and pass."""
    axes, sizes = sweep_axes(dataset), sizes_of(scene_of(dataset.attrs))
    for at in np.argwhere(dataset["status"].to_numpy() == OK):
        run = one_run(dataset.isel({axis: [i] for axis, i in zip(axes, at, strict=True)}))
        parameters = run_parameters(run)
        level = tuple(size.of(run, parameters) for size in sizes)
        middle = run.sel(station=0.0, method="nearest")
        if "pass" not in run.dims:
            middle = middle.expand_dims({"pass": [1]})
        for number in middle["pass"].to_numpy():
            after = middle.sel({"pass": number})
            values = {
                str(name): after["residual_profile"].sel(component=name).to_numpy()
                for name in run["component"].to_numpy()
            }
            if "plastic_strain_profile" in run:
                values[STRAIN] = after["plastic_strain_profile"].to_numpy()
            if any(np.isfinite(each).any() for each in values.values()):  # else not rolled so often
                profile = Profile(
                    depth=run["depth"].to_numpy(), values=values, parameters=parameters
                )
                yield (str(run[CASE].item()), int(number)), level, profile


def _conflict(
    scene: Scene, known: Mapping[Level, Profile], key: Key, level: Level, profile: Profile
) -> tuple[str, list[str]] | None:
    """Return why a profile cannot stand beside those of its case and pass, and what differs."""
    where = "case {}, pass {}".format(*key)
    for other in known.values():
        if found := other_problem(scene, profile.parameters, other.parameters, key[1]):
            return f"{where} is another problem there: {_told(found)}", list(found)
    if level not in known or known[level].agrees_with(profile):
        return None
    found = differences(profile.parameters, known[level].parameters)
    reason = _told(found) or "made with another version of the solver"
    return f"{where} has another result at the same refinement there: {reason}", list(found)


def _told(found: Mapping[str, tuple[Any, Any]]) -> str:
    return ", ".join(
        f"{name} {told(one)}, not {told(other)}" for name, (one, other) in found.items()
    )


def _advised(dataset: xr.Dataset, reason: str, differing: Sequence[str]) -> str:
    """Return the reason of a conflict with what to do: choose, where an axis differs."""
    axes = sweep_coordinates(dataset)
    choices = " ".join(
        f"{name}=VALUE"
        for name in differing
        if name in axes and axes[name] != CASE and dataset.sizes[axes[name]] > 1
    )
    return f"{reason}; " + (f"--select {choices}" if choices else "compare data sets one by one")
