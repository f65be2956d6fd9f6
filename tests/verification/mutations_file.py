"""Faults on the way from an audited record to the file of a run, which reading back must notice.

They are put into what writes files, one at a time, as those of `mutations` into the solver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from solver.results.record import Record, Status
from studies.storage import dataset as layout
from studies.storage import runfile, ugrid
from tests.verification.mutations import Fault, Patch


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFault:
    """A fault, what the refusal tells, and the outcome of the run that is written."""

    fault: Fault
    told: str
    status: Status = Status.OK


def written(change: Callable[[xr.Dataset], xr.Dataset]) -> Fault:
    """The data set of a record that is written is changed."""
    make = layout.run_content

    def changed(scene: Any, case: Any, outcome: Any, *more: Any) -> Any:
        made = make(scene, case, outcome, *more)
        return change(labelled(made)) if isinstance(outcome, Record) else made

    return lambda patch: patch.setattr(layout, "run_content", changed)


def labelled(run: layout.RunContent) -> xr.Dataset:
    """The content of a file as a data set, which writes in the same way."""
    return xr.Dataset(run.variables, attrs=run.attrs)


def values(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """The values of a variable are changed, and nothing else of it."""
    return written(lambda run: run.assign({name: run[name].copy(data=change(run[name].values))}))


def attribute(name: str, **changes: Any) -> Fault:
    """Attributes of a variable are others, or absent (None)."""

    def change(run: xr.Dataset) -> xr.Dataset:
        told = {**run[name].attrs, **changes}
        out = run.assign({name: run[name].copy()})
        out[name].attrs = {key: value for key, value in told.items() if value is not None}
        return out

    return written(change)


def stored(name: str, **changes: Any) -> Fault:
    """A variable is stored in another way."""
    declared = runfile._declared

    def changed(file: Any, each: str, variable: layout.Variable) -> Any:
        usual = layout.storage_of
        with pytest.MonkeyPatch.context() as patch:
            if each == name:
                patch.setattr(layout, "storage_of", lambda given: {**usual(given), **changes})
            return declared(file, each, variable)

    def fault(patch: Patch) -> None:
        patch.setattr(runfile, "_declared", changed)

    return fault


def as_short_integers(name: str, scale: float) -> Fault:
    """A variable is stored as multiples of a number, as netCDF packs values."""

    def change(run: xr.Dataset) -> xr.Dataset:
        whole = np.round(np.nan_to_num(run[name].values) / scale).astype("i2")
        return run.assign({name: (run[name].dims, whole, {**run[name].attrs, **factor})})

    factor = {"scale_factor": scale}
    return written(change)


def in_mesh(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """A variable of the mesh is changed."""
    make = ugrid.variables

    def changed(fields: Any) -> dict[str, Any]:
        found = make(fields)
        dims, array, told = found[name]
        return found | {name: (dims, change(array), told)}

    def fault(patch: Patch) -> None:
        patch.setattr(ugrid, "variables", changed)

    return fault


def swapped(one: str, other: str) -> Fault:
    return written(lambda run: run.assign({one: run[other], other: run[one]}))


def turned(of: np.ndarray) -> np.ndarray:
    """The transpose of maps, in the shape of the maps."""
    return of.swapaxes(-1, -2).reshape(of.shape)


def cut_short(patch: Patch) -> None:
    """Half of the file is lost, and its checksum vouches for what is left."""
    packed = runfile.packed
    patch.setattr(runfile, "packed", lambda run: packed(run)[: len(packed(run)) // 2])


def not_listed(patch: Patch) -> None:
    """A variable is in the file, and no study will combine it."""
    owns = ugrid.owns
    patch.setattr(ugrid, "owns", lambda name, dims: name == "plastic_work" or owns(name, dims))


MAP = "residual_stress"
FILE_FAULTS: dict[str, FileFault] = {
    # values
    "a map times 1e-3": FileFault(fault=values(MAP, lambda v: 1e-3 * v), told=MAP),
    "a map transposed": FileFault(fault=values(MAP, turned), told=MAP),
    "extremes swapped": FileFault(
        fault=swapped("surface_residual_max", "residual_max"), told="surface_residual_max"
    ),
    "numbers swapped": FileFault(
        fault=swapped("max_plastic_strain_punch", "max_plastic_strain_half_plane"),
        told="max_plastic_strain_punch",
    ),
    "NaN for zero": FileFault(
        fault=values("contact_pressure", lambda v: np.where(v == 0.0, np.nan, v)),
        told="contact_pressure has other values",
    ),
    "zero for NaN": FileFault(fault=values(MAP, np.nan_to_num), told=f"{MAP} has other values"),
    "half precision": FileFault(
        fault=values(MAP, lambda v: v.astype(np.float16).astype(float)), told=MAP
    ),
    "a count lost": FileFault(
        fault=values("iterations", lambda v: np.full_like(v, layout.INTEGER_FILL)),
        told="iterations has other values",
    ),
    "depth times 1e-3": FileFault(fault=values("depth", lambda v: 1e-3 * v), told="depth"),
    "x back to front": FileFault(fault=values("x", lambda v: v[::-1]), told="x has other values"),
    "components named in another order": FileFault(
        fault=values("component", lambda v: v[[1, 0, 2, 3]]), told="component has other values"
    ),
    "another friction": FileFault(fault=values("friction", lambda v: v + 0.1), told="friction"),
    # what there is
    "a map missing": FileFault(
        fault=written(lambda run: run.drop_vars(MAP)), told=f"{MAP} is missing"
    ),
    "a coordinate missing": FileFault(
        fault=written(lambda run: run.drop_vars("x")), told="x is missing"
    ),
    "a stage dropped": FileFault(
        fault=written(lambda run: run.isel(stage=[0])), told="contact_pressure has the shape"
    ),
    "a map of other axes": FileFault(
        fault=written(lambda run: run.assign({MAP: run[MAP].transpose(..., "x", "y")})),
        told=f"{MAP} has the dimensions",
    ),
    "a variable too many": FileFault(
        fault=written(lambda run: run.assign(other=run["plastic_work"])),
        told="other is not expected",
    ),
    "a variable that is not listed": FileFault(fault=not_listed, told="list of its variables"),
    # words
    "Pa for MPa": FileFault(fault=attribute(MAP, units="Pa"), told="the units 'Pa', not 'MPa'"),
    "no unit": FileFault(fault=attribute("depth", units=None), told="depth has the units None"),
    "another meaning": FileFault(
        fault=attribute(MAP, long_name="stress under load"), told="'stress under load'"
    ),
    "ok for audit_failed": FileFault(
        fault=values("status", lambda v: np.full_like(v, "ok")),
        told="status has other values",
        status=Status.AUDIT_FAILED,
    ),
    "another message": FileFault(
        fault=values("message", lambda v: np.full_like(v, "all is well")), told="message"
    ),
    "a half for the whole": FileFault(
        fault=written(lambda run: run.assign_attrs(symmetric=0)), told="attribute symmetric is 0"
    ),
    "parameters of another run": FileFault(
        fault=written(
            lambda run: run.assign_attrs(
                parameters=run.attrs["parameters"].replace('"growth": 2.0', '"growth": 1.5')
            )
        ),
        told="its parameters",
    ),
    # how it is stored
    "single precision": FileFault(fault=stored(MAP, datatype="f4"), told="numbers of 4 bytes"),
    "rounded by compression": FileFault(
        fault=stored(MAP, significant_digits=4), told=f"{MAP} has other values"
    ),
    "packed as short integers": FileFault(
        fault=as_short_integers("plastic_strain", 1e-4),
        told="plastic_strain has the scale_factor 0.0001",
    ),
    "zero as what is absent": FileFault(
        fault=stored("contact_pressure", fill_value=0.0),
        told="contact_pressure has the fill value 0.0",
    ),
    "a range of what is valid": FileFault(
        fault=attribute("map_mises", valid_max=100.0), told="the valid_max 100.0"
    ),
    "cut short": FileFault(fault=cut_short, told="it cannot be read: OSError"),
    # the mesh
    "nodes in another order": FileFault(
        fault=in_mesh("mesh_node_x", lambda v: v[::-1]), told="mesh_node_x"
    ),
    "stress of the other stage": FileFault(
        fault=in_mesh("mesh_stress_xx", lambda v: v[::-1]), told="mesh_stress_xx"
    ),
    "cells of the other body": FileFault(
        fault=in_mesh("mesh_cell_body", lambda v: 1 - v), told="mesh_cell_body"
    ),
}


def every_run_is_ok(patch: Patch) -> None:
    """The status word is wrong in each file, that of a broken run too."""
    packed = runfile.packed

    def fault(run: layout.RunContent) -> bytes:
        status = run.variables["status"]._replace(values=np.full((1, 1, 1), "ok"))
        return packed(replace(run, variables={**run.variables, "status": status}))

    patch.setattr(runfile, "packed", fault)
