"""Which parameter matters: indices of sensitivity from the runs of a study that are there.

The runs are fitted with a sum of polynomials (`studies.views.chaos`), from which the indices follow
without further runs. How far they can be trusted is told by fits that leave out a tenth of the runs
in turn: Q² is the share of the variance of the runs left out that these fits predict, and the
spread of their indices is that of a jackknife. An index is known to twice its jackknife error, what
it moves with the ends of the ranges, and half of the variance that is not predicted.

References
----------
Sobol', I. M. (2001), Global sensitivity indices for nonlinear mathematical models and their Monte
Carlo estimates, Math. Comput. Simul. 55: first-order and total indices. Efron, B. and Tibshirani,
R. J. (1993), An Introduction to the Bootstrap, section 11.5: the jackknife with groups.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.vocabulary import OK
from studies.errors import StudyError, one_of
from studies.views.chaos import DEGREES, Chaos, Numbers, bears, fitted
from studies.views.columns import aligned, or_none, value_text
from studies.views.fits import TENTHS, by_content, check_predicted, share_predicted, tenths
from studies.views.picking import flags, parameters_over, point_axes, select, sweep_axes
from studies.views.plots.fields import sweep_fields, wide_fields
from studies.views.table import one_number

METHODS = ("chaos", "delta", "pawn", "rbd_fast")
"""The fit of this module, and methods of the library SALib."""
_RUNS = 4
"""Least number of runs for each parameter, and for the mean."""
_FAILED = 0.05
"""Largest share of runs without a number."""
_VALUES = 3
"""Least number of values of a parameter: two do not tell a line from a curve."""
_SHARES = 41
"""Places at which the effect of a parameter is told."""


def sensitivity(
    dataset: xr.Dataset,
    of: str,
    selection: Mapping[str, str | float] | None = None,
    *,
    method: str = "chaos",
) -> xr.Dataset:
    """Return indices of sensitivity of a number of the runs to each parameter that varies.

    The parameters count as independent, each uniform between its lowest and its highest value; or
    uniform in its logarithm, where the runs are spread that way.

    Parameters
    ----------
    dataset : data set of a study: of a sample, or of a grid
    of : a variable with one number a run
    selection : value for each selected axis, or parameter set by an axis, as in `select`
    method : ``chaos``; or ``delta``, ``pawn`` or ``rbd_fast`` of the library SALib, if it is
        installed (extra ``sensitivity``)

    Returns
    -------
    xarray.Dataset : over ``parameter``. Of ``chaos``: ``first`` and ``total``, the share of the
        variance that a parameter makes alone, and with others; ``first_error``, ``total_error``, so
        that the index is within them; ``effect`` over ``share``, the mean of the number at
        ``place`` of the parameter. The attributes have ``q2``, ``runs`` and ``terms``. Of the other
        methods: their indices, by their names there

    Raises
    ------
    StudyError
        if the sample does not bear it: too few runs, too many failed ones, a parameter that has
        words or less than three values, or a fit that predicts too little
    """
    if method not in METHODS:
        raise StudyError("method", method, one_of(method, METHODS))
    chosen = select(dataset, selection or {})
    known = [name for name in sweep_fields(chosen) if not flags(chosen[name])]
    if of not in known:
        raise StudyError("of", of, one_number(of, known, wide_fields(chosen)))
    scales, places, values = _sampled(chosen, of)
    attrs: dict[str, Any] = {
        **{key: chosen[of].attrs[key] for key in ("long_name", "units") if key in chosen[of].attrs},
        "of": of, "method": method, "runs": len(values), "failed": chosen[of].size - len(values),
    }  # fmt: skip
    if method == "chaos":
        found = _indices(places, values, np.array([scale.unsure for scale in scales]), of)
    else:
        found = _of_library(method, places, values)
    shares = np.linspace(0.0, 1.0, _SHARES)
    at = np.array([scale.at(shares) for scale in scales])
    found = found.assign_coords(parameter=[scale.name for scale in scales])
    found["place"] = ("parameter", "share"), at, {"long_name": "place of the parameter"}
    found["units"] = "parameter", [str(chosen[s.name].attrs.get("units", "1")) for s in scales]
    return found.assign_attrs(attrs)


class _Scale:
    """The range of a parameter: linear or logarithmic, whichever its values fill more evenly.

    Values of a grid include the ends of the range. Those of a sample lie one in each of equal
    intervals: the ends are those of the straight line through the sorted values, and are known to
    twice their standard error, `unsure`, as a share of the range.
    """

    def __init__(self, name: str, values: Numbers) -> None:
        self.name = name
        own = np.unique(values)
        self.log = bool(own[0] > 0.0 and _uneven(np.log(own)) < _uneven(own))
        scaled, count = self._scaled(own), len(own)
        self.low, self.high, self.unsure = scaled[0], scaled[-1], 0.0
        if count > len(values) / 2:
            shares = (np.arange(count) + 0.5) / count
            slope, at_zero = np.polyfit(shares, scaled, 1)
            spread = np.std(scaled - at_zero - slope * shares) / slope
            self.low, self.high = min(at_zero, self.low), max(at_zero + slope, self.high)
            self.unsure = float(2.0 * spread)

    def place(self, values: Numbers) -> Numbers:
        """Return places from -1 to 1."""
        return 2.0 * (self._scaled(values) - self.low) / (self.high - self.low) - 1.0

    def at(self, shares: Numbers) -> Numbers:
        """Return the values at shares of the way."""
        scaled = self.low + (self.high - self.low) * shares
        return np.exp(scaled) if self.log else scaled

    def _scaled(self, values: Numbers) -> Numbers:
        return np.log(values) if self.log else values


def _uneven(values: Numbers) -> float:
    """Return the largest distance of sorted values from even ones, as a share of their range."""
    even = np.linspace(values[0], values[-1], len(values))
    return float(np.abs(values - even).max() / np.ptp(values))


def _sampled(dataset: xr.Dataset, of: str) -> tuple[list[_Scale], Numbers, Numbers]:
    """Return the parameters that vary, the places of the runs, and their numbers, or refuse."""
    points, varied = point_axes(dataset), list[str]()
    for axis in sweep_axes(dataset):
        if axis in points:
            varied += parameters_over(dataset, axis)
        elif dataset.sizes[axis] > 1:
            varied.append(axis)
    for name in varied:
        own = np.unique(dataset[name])
        if dataset[name].dtype.kind not in "fiu":
            some = ", ".join(map(str, own[:4]))
            raise StudyError("parameters", name, f"has words: select one of them ({some})")
        if len(own) < _VALUES:
            allowed = f"has {len(own)} values: {_VALUES} at least tell a line from a curve"
            raise StudyError("parameters", name, allowed)
    if not varied:
        raise StudyError("parameters", "none", "varies in these runs: a sample is needed")
    fields = [dataset[name] for name in varied]
    columns = [each.to_numpy().ravel() for each in xr.broadcast(dataset[of], *fields)]
    status = dataset["status"].transpose(*dataset[of].dims).to_numpy().ravel()
    there = (status == OK) & np.isfinite(columns[0].astype(float))
    values, *places = (each[there].astype(float) for each in columns)
    least = _RUNS * (len(varied) + 1)
    if len(values) < least:
        allowed = f"too few for {len(varied)} parameters: at least {least} with a number are needed"
        raise StudyError("runs", f"{len(values)}", allowed)
    if (failed := 1.0 - there.mean()) > _FAILED:
        allowed = (
            f"have no {of}, which is a share of {failed:.0%}, and at most {_FAILED:.0%} may: where "
            "runs fail the number is not known; make ranges smaller, or select"
        )
        raise StudyError("runs", f"{(~there).sum()} of {there.size}", allowed)
    if not np.ptp(values) > 1e-12 * np.abs(values).max():
        raise StudyError("of", of, "is the same in all runs")
    scales = list(map(_Scale, varied, columns[1:]))
    shares = [scale.place(own) for scale, own in zip(scales, places, strict=True)]
    return scales, np.column_stack(shares), values


@by_content
def _indices(places: Numbers, values: Numbers, unsure: Numbers, of: str) -> xr.Dataset:
    """Return the indices of a fit, or refuse one that predicts too little.

    The ends of the range of each parameter are known to a share of it, ``unsure``.
    """
    borne = [each for each in DEGREES if bears(len(values), places.shape[1], each)]
    tried = (_predicted(places, values, degree) for degree in borne)
    q2, degree, parts = max(tried, key=lambda each: each[0])
    check_predicted(of, q2, len(values))
    whole = fitted(places, values, degree)
    spread = np.sum((parts - np.mean(parts, axis=0)) ** 2, axis=0)
    first, total = whole.indices()
    wider = places / (1.0 + 2.0 * np.diag(unsure))[:, None]  # one parameter at a time
    moved = [np.concatenate(fitted(each, values, degree).indices()) for each in wider[unsure > 0.0]]
    spread = 4.0 * (TENTHS - 1) / TENTHS * spread
    for each in moved:
        spread += (each - np.concatenate([first, total])) ** 2
    error = np.sqrt(spread) + (1.0 - q2) / 2.0
    words = "share of the variance that the parameter makes"
    return xr.Dataset(
        {
            "first": ("parameter", first, {"long_name": f"{words} alone"}),
            "first_error": ("parameter", error[: len(first)]),
            "total": ("parameter", total, {"long_name": f"{words} alone and with others"}),
            "total_error": ("parameter", error[len(first) :]),
            "effect": (("parameter", "share"), _effects(whole), {"long_name": "mean of the runs"}),
        },
        attrs={"q2": q2, "terms": len(whole.coefficients)},
    )


def _predicted(places: Numbers, values: Numbers, degree: int) -> tuple[float, int, Numbers]:
    """Return Q² of fits that leave out a tenth, the degree, and the indices of each fit."""
    misses, found = np.empty_like(values), []
    for out in tenths(len(values)):
        part = fitted(places[~out], values[~out], degree)
        misses[out] = values[out] - part(places[out])
        found.append(np.concatenate(part.indices()))
    return share_predicted(values, misses), degree, np.array(found)


def _effects(whole: Chaos) -> Numbers:
    """Return the mean over all other parameters along each parameter: (n_parameters, n_shares)."""
    line = np.linspace(-1.0, 1.0, _SHARES)
    return np.array([whole.alone(k, line) for k in range(whole.degrees.shape[1])])


def _of_library(method: str, places: Numbers, values: Numbers) -> xr.Dataset:
    """Return the indices that a method of SALib finds, which needs no fit."""
    try:
        from SALib.analyze import delta, pawn, rbd_fast
    except ImportError:
        allowed = "needs the library SALib: pip install residua-contact[sensitivity]"
        raise StudyError("method", method, allowed) from None
    count = places.shape[1]
    problem = {
        "num_vars": count, "names": [str(k) for k in range(count)], "bounds": [[-1.0, 1.0]] * count
    }  # fmt: skip
    analyze = {"delta": delta, "pawn": pawn, "rbd_fast": rbd_fast}[method].analyze
    more = {"method": "delta"} if method == "delta" else {}
    state = np.random.get_state()  # noqa: NPY002  # the library seeds the generator of all
    try:
        found = analyze(problem, places, values, seed=1, **more)  # it takes 0 for none
    finally:
        np.random.set_state(state)  # noqa: NPY002
    numbers = {key: np.asarray(each) for key, each in found.items()}
    numbers = {key: each for key, each in numbers.items() if each.dtype.kind == "f"}
    return xr.Dataset({key: ("parameter", each) for key, each in numbers.items()})


def main_index(found: xr.Dataset) -> str:
    """Return the index by which parameters are ordered: the total one, or the first of a method."""
    return "total" if "total" in found else _each_parameter(found)[0]


def _each_parameter(found: xr.Dataset) -> list[str]:
    """Return the variables with a value for each parameter."""
    return [str(name) for name, each in found.data_vars.items() if each.dims == ("parameter",)]


def ordered(found: xr.Dataset) -> list[int]:
    """Return the numbers of the parameters, that of the largest index first."""
    return np.argsort(-found[main_index(found)].to_numpy(), kind="stable").tolist()


def sensitivity_table(found: xr.Dataset) -> str:
    """Return a line for each parameter, that of the largest index first, and how sure it is."""
    chaos = found.attrs["method"] == "chaos"
    columns = [n for n in _each_parameter(found) if n != "units" and not n.endswith("_error")]
    lines = [["parameter", *columns]]
    for k in ordered(found):
        one = found.isel(parameter=k)
        numbers = [
            f"{one[name].item():.3f} ± {one[f'{name}_error'].item():.3f}"
            if f"{name}_error" in one
            else value_text(one[name].item())
            for name in columns
        ]
        lines.append([str(one["parameter"].item()), *numbers])
    about = f"{found.attrs['of']}: {found.attrs['runs']} runs"
    if found.attrs["failed"]:
        about += f", and {found.attrs['failed']} without a number"
    if chaos:
        terms, q2 = found.attrs["terms"], found.attrs["q2"]
        about += f"; the fit has {terms} terms and predicts Q2 = {q2:.3f}"
    return f"{aligned(lines, 1)}\n\n{about}"


def told(found: xr.Dataset) -> dict[str, Any]:
    """Return the indices as JSON has them: by parameter, and what is told of the fit."""
    names = _each_parameter(found)
    rows = {
        str(one["parameter"].item()): {name: or_none(one[name].item()) for name in names}
        for one in (found.isel(parameter=k) for k in range(found.sizes["parameter"]))
    }
    about = {key: or_none(value) for key, value in found.attrs.items()}
    return about | {"parameters": rows}
