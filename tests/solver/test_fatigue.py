"""Fatigue criteria on paths: published numbers, closed forms, invariance."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from solver.errors import ModelError
from solver.fatigue import (
    CRITERIA,
    BrownMiller,
    Criterion,
    Crossland,
    DangVan,
    FatemiSocie,
    Findley,
    Matake,
    Paths,
    PlaneCriterion,
    SmithWatsonTopper,
    arrest,
    crack_damage,
    opened_range,
    stress_intensity,
    subsurface_index,
    surface_index,
    t_gamma,
)
from solver.fatigue.kernels import balls
from solver.fatigue.planes import (
    _FALLS,
    _FULL,
    _NORMALS,
    OnPlanes,
    Value,
    _Ascent,
    _hemisphere,
    critical_planes,
)
from solver.tensors import _PLACES
from solver.typing import Array

LIMITS = {"torsion": 352.0, "bending": 540.97}
G, NU = 200e3 / 2.6, 0.3
EVERY: tuple[Criterion, ...] = (
    Crossland(**LIMITS), DangVan(**LIMITS), Findley(**LIMITS), Matake(**LIMITS), FatemiSocie(),
    SmithWatsonTopper(), BrownMiller(),
)  # fmt: skip


def cycle(*instants: Sequence[float]) -> Array:
    """Return the path (1, n_instants, 6) of one point."""
    return np.array([instants], dtype=float)


def elastic(stress: Array) -> Paths:
    """Return paths with the elastic strain of their stress."""
    strain = stress / (2 * G)
    strain[..., :3] -= NU / (1 + NU) * stress[..., :3].sum(axis=2, keepdims=True) / (2 * G)
    return Paths(stress, strain)


def searching(paths: Paths, search: Value, read: Sequence[int] = range(6)) -> _Ascent:
    """Return what a search knows of paths; it reads some of the values of `OnPlanes`."""
    x = np.ascontiguousarray(np.stack(paths.known, axis=1).swapaxes(2, 3))
    return _Ascent(x, np.array(read), search)


def acting(cycle: _Ascent, normal: Array) -> OnPlanes:
    """Return what acts on a plane (3,), or on one (n, 3) of each point."""
    every = np.arange(len(cycle.paths))
    normals = np.array(np.broadcast_to(normal, (len(every), 3)), order="C")
    return OnPlanes(*cycle.resolved(every, normals)[0])


def rotated(tensor: Array, turns: Array) -> Array:
    """Return tensors (n, n_instants, 6), each path turned by its matrix (n, 3, 3)."""
    full = np.empty((*tensor.shape[:2], 3, 3))
    for k, (i, j) in enumerate(_PLACES):
        full[..., i, j] = full[..., j, i] = tensor[..., k]
    full = np.einsum("pik,ptkl,pjl->ptij", turns, full, turns)
    return np.stack([full[..., i, j] for i, j in _PLACES], axis=-1)


BENT_AND_TWISTED = cycle((411, 0, 0, 205, 0, 0), (-411, 0, 0, -205, 0, 0))
"""Bending and torsion in phase: Code_Aster, szlz107a."""
PULLED = elastic(cycle((200, 0, 0, 0, 0, 0), (-200, 0, 0, 0, 0, 0)))


def test_published_numbers_of_bending_and_torsion() -> None:
    paths = Paths(BENT_AND_TWISTED)
    assert paths.deviator_balls[1][0] / 2**0.5 == pytest.approx(313.579, rel=1e-5)
    assert paths.pressure.max() == pytest.approx(137.0, rel=1e-12)
    found = Crossland(torsion=352.0, sensitivity=0.22).assess(paths)
    assert found.value[0] - 352.0 == pytest.approx(-8.281, abs=1e-3)
    assert Crossland(**LIMITS).factor == pytest.approx(0.22, rel=1e-4)
    assert DangVan(**LIMITS).assess(paths).utilisation[0] == pytest.approx(1.00056, rel=1e-5)
    for k, value in {0.1: 312.265, 0.2: 337.116, 0.3: 364.698}.items():
        found = Findley(torsion=352.0, sensitivity=k).assess(paths)
        assert found.value[0] == pytest.approx(value, rel=1e-5)


def test_published_numbers_of_tension_and_compression() -> None:
    """Code_Aster, sslv135a, multiplies shear by 1.5; then closed forms of one stress."""
    for criterion, value in {
        Matake(torsion=200.0, sensitivity=1.0): 300.0,
        DangVan(torsion=200.0, sensitivity=1.25): 275.0,
    }.items():
        found = criterion.assess(PULLED)
        assert 1.5 * found.value[0] == pytest.approx(value, rel=1e-5)
        assert abs(found.plane[0, 0]) == pytest.approx(np.cos(np.pi / 4), rel=1e-5)
    found = FatemiSocie().assess(PULLED)
    assert found.value[0] == pytest.approx(1.40088e-3, rel=1e-5)
    assert np.degrees(np.arccos(abs(found.plane[0, 0]))) == pytest.approx(43.02, abs=5e-3)
    found = SmithWatsonTopper(endured=0.4).assess(PULLED)
    assert (found.value[0], found.safety_factor[0]) == pytest.approx((0.2, 2.0), rel=1e-10)
    value = BrownMiller(sensitivity=0.3).assess(PULLED).value[0]
    assert value == pytest.approx(1.3e-3 + 0.3 * 2 * 0.35e-3, rel=1e-5)


def test_both_limits_are_reached_by_the_cycles_that_they_are_of() -> None:
    t, f = LIMITS["torsion"], LIMITS["bending"]
    twisted = Paths(cycle((0, 0, 0, t, 0, 0), (0, 0, 0, -t, 0, 0)))
    bent = Paths(cycle((f, 0, 0, 0, 0, 0), (-f, 0, 0, 0, 0, 0)))
    for criterion in EVERY[:4]:
        for paths in (twisted, bent):
            assert criterion.assess(paths).utilisation[0] == pytest.approx(1.0, rel=2e-6)


def paths_of(kind: str, count: int = 60) -> Array:
    """Return seeded paths (count, n_instants, 6) of a kind."""
    rng = np.random.default_rng(2)
    t = np.linspace(0.0, 2 * np.pi, 100, endpoint=False)[:, None]
    size = 100 * rng.normal(size=(4, count, 1, 6))
    if kind == "in phase":
        return size[0] + size[1] * np.sin(t[::4])
    if kind == "pulled":  # a whole ring of planes is critical
        stress = np.zeros((count, 25, 6))
        stress[..., 0] = np.abs(size[0, ..., 0]) + size[1, ..., 0] * np.sin(t[::4, 0])
        return stress
    if kind == "few instants":
        return 100 * rng.normal(size=(count, 5, 6))
    phase = rng.uniform(0, 2 * np.pi, (3, count, 1, 6))
    waves = (own / (k + 1) * np.sin((k + 1) * t + phase[k]) for k, own in enumerate(size[1:]))
    return size[0] + sum(waves)


def test_paths_that_reverse_in_proportion_are_closed_forms() -> None:
    """Of principal amplitudes 1 to 3: Mohr's outer circle has the largest shear and normal stress.

    Crossland sqrt(J2) + a |p|, Dang Van r + a |p|, Matake r + k |c|, and Findley
    r sqrt(1 + k^2) + k |c|, with r = (s1 - s3) / 2 and c = (s1 + s3) / 2.
    """
    amplitude = paths_of("few instants", 200)[:, :1]
    s = np.linalg.eigvalsh(amplitude[:, 0, _FULL])
    p, r, c = s.mean(axis=1), (s[:, 2] - s[:, 0]) / 2, np.abs(s[:, 2] + s[:, 0]) / 2
    root = np.sqrt(((s - p[:, None]) ** 2).sum(axis=1) / 2)
    k, paths = 0.3, Paths(amplitude * np.sin(np.linspace(0.0, 2 * np.pi, 13))[:, None])
    for criterion, value in {
        Crossland(torsion=1.0, sensitivity=k): root + k * np.abs(p),
        DangVan(torsion=1.0, sensitivity=k): r + k * np.abs(p),
        Matake(torsion=1.0, sensitivity=k): r + k * c,
        Findley(torsion=1.0, sensitivity=k): r * np.sqrt(1 + k**2) + k * c,
    }.items():
        np.testing.assert_allclose(criterion.assess(paths).value, value, rtol=1e-6)


@pytest.mark.parametrize("kind", ["in phase", "pulled", "few instants", "out of phase"])
@pytest.mark.parametrize("criterion", EVERY, ids=lambda each: type(each).__name__)
def test_rotation_changes_nothing(criterion: Criterion, kind: str) -> None:
    stress = paths_of(kind)
    other = rotated(stress, Rotation.random(len(stress), random_state=3).as_matrix())
    before, after = (criterion.assess(elastic(paths)).value for paths in (stress, other))
    np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-12 * np.abs(before).max())


def test_smallest_ball_is_the_least_of_all() -> None:
    """Its centre is a mean of the points on it: no other ball is as small."""
    x = np.random.default_rng(4).normal(size=(50, 5, 40))
    centres, radii = balls(x)
    away = np.linalg.norm(x - centres[:, :, None], axis=1)
    np.testing.assert_allclose(away.max(axis=1), radii, rtol=1e-13)
    for path, centre, far, radius in zip(x, centres, away, radii, strict=True):
        on = path[:, far > radius * (1 - 1e-10)]
        shares = np.linalg.lstsq(np.vstack([on, np.ones(on.shape[1])]), [*centre, 1.0])[0]
        assert shares.min() > -1e-9
        np.testing.assert_allclose(on @ shares, centre, atol=1e-9)


def line_contact(depth: Array, x: Array) -> Array:
    """Return the stress (depth, x, 6) below a cylinder, over p0 and a, without friction.

    K.L. Johnson, Contact Mechanics (1985), eqs. 4.49; plane strain.
    """
    z, x = depth[:, None], x[None]
    root = np.sqrt((1 - x**2 + z**2) ** 2 + 4 * x**2 * z**2)
    m, n = (np.sqrt((root + s * (1 - x**2 + z**2)) / 2) for s in (1, -1))
    n = n * np.sign(x)
    ratio = (z**2 + n**2) / (m**2 + n**2)
    stress = np.zeros((*root.shape, 6))
    stress[..., 0] = -(m * (1 + ratio) - 2 * z)
    stress[..., 1] = -m * (1 - ratio)
    stress[..., 2] = NU * (stress[..., 0] + stress[..., 1])
    stress[..., 3] = n * (m**2 - z**2) / (m**2 + n**2)
    return stress


def test_an_elastic_rolling_contact_is_worst_where_theory_says() -> None:
    depth, x = np.linspace(0.02, 1.5, 75), np.linspace(-8, 8, 801)
    paths = Paths(line_contact(depth, x))
    amplitude = paths.deviator_balls[1] / 2**0.5
    assert amplitude.max() == pytest.approx(0.25, rel=0.01)
    assert depth[amplitude.argmax()] == pytest.approx(0.50, abs=0.02)
    value = DangVan(torsion=1.0, sensitivity=0.3).assess(paths).value
    assert value.max() == pytest.approx(0.1706, rel=0.01)
    assert depth[value.argmax()] == pytest.approx(0.60, abs=0.02)


def test_no_plane_of_a_rolling_pass_is_worse_than_the_critical_one() -> None:
    """Few of the 129 instants are under the load, and the scan must see them."""
    path = 1000 * line_contact(np.linspace(0.05, 1.5, 20), np.linspace(-40, 40, 129))
    path[..., 0] += 200.0
    paths, along = elastic(path), np.linspace(0, np.pi, 13)[:-1]
    normals = np.random.default_rng(5).normal(size=(600, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(normals, first)
    directions = np.cos(along) * first[..., None] + np.sin(along) * second[..., None]
    full = path[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
    traction = np.einsum("ptij,mj->ptmi", full, normals)
    normal = np.einsum("ptmi,mi->ptm", traction, normals)
    shear = np.ptp(np.einsum("ptmi,mid->ptmd", traction, directions), axis=1).max(axis=2) / 2
    assert paths.strain is not None
    strain = paths.strain[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
    half = np.ptp(np.einsum("ptij,mi,mj->ptm", strain, normals, normals), axis=1) / 2
    for criterion, dense in (
        (Findley(torsion=352.0, sensitivity=0.3), shear + 0.3 * normal.max(axis=1)),
        (SmithWatsonTopper(), normal.max(axis=1) * half),
    ):
        assert (criterion.assess(paths).value > dense.max(axis=1) * (1 - 1e-3)).all()


@pytest.mark.parametrize("kind", ["few instants", "out of phase"])
def test_hardly_a_plane_is_worse_than_the_critical_one(kind: str) -> None:
    """Newton's method from the best of 1000 planes, at distances, finds what the search finds.

    It may find a little more at one of 100 points: no bound of so little is proved.
    """
    count, criterion = 200, FatemiSocie()
    paths = elastic(paths_of(kind, count))
    cycle = searching(paths, criterion.on_plane, (1, 3))
    planes, values = _hemisphere(1000), np.empty((count, 1000))
    for k, plane in enumerate(planes):
        values[:, k] = criterion.on_plane(acting(cycle, plane))
    best = values.max(axis=1)
    for _ in range(4):
        start = planes[values.argmax(axis=1)]
        best = np.maximum(best, cycle.climbed(np.arange(count), start, -np.inf).best)
        values[np.abs(np.einsum("mj,nj->nm", planes, start)) > np.cos(0.05)] = -np.inf
    least = criterion.assess(paths).value / best
    assert least.min() > 1 - 1e-3 and np.sort(least)[count // 100] > 1 - 1e-12


@pytest.mark.parametrize("criterion", EVERY[2:], ids=lambda each: type(each).__name__)
def test_the_plane_reported_is_that_of_the_value(criterion: PlaneCriterion) -> None:
    """Of 20 000 paths in all; it is worse than its neighbours, in what is searched."""
    paths = elastic(paths_of("few instants", 4000))
    found, cycle = criterion.assess(paths), searching(paths, criterion.searched)
    on = acting(cycle, found.plane)
    np.testing.assert_allclose(criterion.on_plane(on), found.value, rtol=1e-9)
    rng, most = np.random.default_rng(6), criterion.searched(on)
    for step in (1e-3, 1e-2):
        moved = found.plane + step * rng.normal(size=(4000, 3))
        moved /= np.linalg.norm(moved, axis=1)[:, None]
        assert (criterion.searched(acting(cycle, moved)) <= most * (1 + 1e-9)).all()


def barely_opened(share: float) -> Paths:
    """Return paths whose largest principal stress is a share of the range of principal stress."""
    stress = paths_of("out of phase", 40)
    values = np.linalg.eigvalsh(stress[..., _FULL])
    size = np.ptp(values.reshape(len(stress), -1), axis=1)
    stress[..., :3] += (share * size - values.max(axis=(1, 2)))[:, None, None]
    return elastic(stress)


def densely(stress: Array, strain: Array) -> float:
    """Return the largest Smith-Watson-Topper parameter of a path, from many planes by trial.

    Planes are those of a hemisphere and of the largest principal stress at each instant; the best
    four move to the best of eight planes around them, at distances that are halved.
    """
    full, other = stress[:, _FULL], strain[:, _FULL]

    def value(normals: Array) -> Array:
        normal, across = (((each @ normals.T) * normals.T).sum(axis=1) for each in (full, other))
        return np.asarray(np.maximum(normal.max(axis=0), 0.0) * np.ptp(across, axis=0) / 2)

    normals = np.concatenate([_hemisphere(300), np.linalg.eigh(full)[1][:, :, 2]])
    best = value(normals)
    normals, best = normals[np.argsort(-best)[:4]], np.sort(best)[:-5:-1]
    step, angle = 0.05, np.arange(8) * np.pi / 4
    while step > 1e-6:
        first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
        second = np.cross(normals, first)
        around = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
        moved = normals[:, None] + step * around
        moved /= np.linalg.norm(moved, axis=2)[..., None]
        values = value(moved.reshape(-1, 3)).reshape(4, 8)
        k = values.argmax(axis=1)
        higher = values.max(axis=1) > best
        normals[higher], best[higher] = moved[higher, k[higher]], values.max(axis=1)[higher]
        step /= 1 if higher.any() else 2
    return float(best.max())


@pytest.mark.parametrize("share", [0.02, 0.005, 0.001])
def test_tension_between_the_planes_of_the_scan_is_found(share: float) -> None:
    """The planes in tension are within asin(sqrt(share)) of a direction: the scan misses many."""
    paths = barely_opened(share)
    assert paths.strain is not None
    dense = [densely(*each) for each in zip(paths.stress, paths.strain, strict=True)]
    value = SmithWatsonTopper().assess(paths).value
    assert (value > 0).all() and (value >= np.array(dense) * (1 - 1e-9)).all()


CURVED: dict[str, Callable[[OnPlanes], Array]] = {
    "root of shear": lambda on: np.sqrt(on.shear),
    "root of a product": lambda on: np.sqrt(np.maximum(on.normal, 0.0) * on.strain_half * 2e5),
    "powers": lambda on: np.maximum(on.normal, 0.0) ** 0.25 * on.shear**0.75,
    "a high power": lambda on: np.maximum(on.normal, 0.0) ** 8 + on.shear**8,
    "never positive": lambda on: np.minimum(on.normal - 150.0, 0.0),
    "logarithm": lambda on: np.log1p(on.shear / 100) + np.log1p(on.normal_half / 100),
}


@pytest.mark.parametrize("kind", ["in phase", "few instants", "out of phase"])
@pytest.mark.parametrize("form", CURVED)
def test_a_criterion_may_curve_either_way(form: str, kind: str) -> None:
    """No plane of many is worse, and what acts is that on the plane reported."""
    paths, criterion = elastic(paths_of(kind)), CURVED[form]
    found, cycle = critical_planes(paths, criterion), searching(paths, criterion)
    most = np.full(60, -np.inf)
    for plane in _hemisphere(800):
        most = np.maximum(most, criterion(acting(cycle, plane)))
    value = criterion(found.on)
    assert (value >= most).all()
    np.testing.assert_allclose(value, criterion(acting(cycle, found.normal)), rtol=1e-12)


@pytest.mark.parametrize("modulus", [1.0, 1e2, 1e6])
def test_units_of_stress_and_strain_change_nothing(modulus: float) -> None:
    """A curved criterion of both, of strain that is much larger or smaller than stress."""
    paths = elastic(paths_of("few instants"))
    assert paths.strain is not None

    def criterion(on: OnPlanes) -> Array:
        return np.sqrt(np.maximum(on.normal, 0.0) * on.strain_half)

    other = Paths(1e-3 * paths.stress, 200e3 / modulus * paths.strain)
    value, scaled = (criterion(critical_planes(each, criterion).on) for each in (paths, other))
    np.testing.assert_allclose(scaled, value * np.sqrt(200 / modulus), rtol=1e-12)


@pytest.mark.parametrize("turn", [0.0, 15.0, 45.0])
def test_a_triangle_of_shear_is_as_bad_as_its_circle(turn: float) -> None:
    """The scan sees .8365 of it at 15 degrees: less than of a smaller straight path elsewhere."""
    angle = np.radians(np.array([0.0, 120.0, 240.0]) + turn)
    stress = np.zeros((1, 5, 6))
    stress[0, :3, 5], stress[0, :3, 4] = 1.09 * np.cos(angle), 1.09 * np.sin(angle)
    stress[0, 3:, 0], stress[0, 3:, 1] = (1.0, -1.0), (-1.0, 1.0)
    found = critical_planes(Paths(stress), lambda on: on.shear)
    assert found.on.shear == pytest.approx([1.09]) and found.normal[0, 2] == pytest.approx(1.0)


@pytest.mark.parametrize("share", [0.0, 1e-6, 1e-3])
def test_points_without_stress_or_nearly_hydrostatic_have_their_plane(share: float) -> None:
    """The first point has no stress, the others a pressure that cycles and little besides."""
    rng = np.random.default_rng(4)
    pressure = 100 * (1 + np.sin(np.linspace(0, 2 * np.pi, 12)))[:, None] * [1, 1, 1, 0, 0, 0]
    stress = pressure + 100 * share * rng.normal(size=(5, 12, 6))
    stress[0] = 0
    criterion = Findley(torsion=300.0, sensitivity=0.3)
    together = criterion.assess(Paths(stress)).value
    assert together.shape == (5,) and together[0] == pytest.approx(0.0, abs=1e-9)
    each = [criterion.assess(Paths(own[None])).value[0] for own in stress[1:]]
    assert together[1:] == pytest.approx(each, rel=1e-9)
    assert (together[1:] >= 0.3 * 200 * (1 - 0.1)).all()


def test_a_path_has_two_instants_or_more() -> None:
    with pytest.raises(ModelError, match="2 instants or more"):
        Paths(cycle((300, 0, 0, 0, 0, 0)))


def test_paths_in_the_plane_are_paths_in_space() -> None:
    stress = BENT_AND_TWISTED[..., :4]
    for criterion in EVERY[:4]:
        found, whole = criterion.assess(Paths(stress)), criterion.assess(Paths(BENT_AND_TWISTED))
        assert found.value == pytest.approx(whole.value, rel=0.0)


def test_a_cycle_in_compression_does_no_damage() -> None:
    pressed = elastic(cycle((-100, 0, 0, 0, 0, 0), (-300, 0, 0, 0, 0, 0)))
    assert SmithWatsonTopper().assess(pressed).safety_factor[0] == np.inf


def test_mistakes_name_their_field() -> None:
    for field, make in {
        "bending": lambda: DangVan(torsion=300.0, bending=1000.0),
        "torsion": lambda: DangVan(torsion=-300.0, sensitivity=0.3),
        "stress": lambda: Paths(np.zeros((3, 6))),
        "strain": lambda: SmithWatsonTopper().assess(Paths(BENT_AND_TWISTED)),
    }.items():
        with pytest.raises(ModelError) as error:
            make()
        assert error.value.field == field


def test_a_criterion_that_cannot_be_searched_is_refused() -> None:
    still, pulled = Paths(np.zeros((1, 2, 6))), Paths(PULLED.stress)
    with np.errstate(divide="ignore"), pytest.raises(ModelError, match="must be finite"):
        critical_planes(still, lambda on: np.log(on.shear))
    with pytest.raises(ModelError, match="must not fall where `normal_half` rises"):
        critical_planes(pulled, lambda on: on.normal - on.normal_half)


def test_criteria_have_words() -> None:
    assert set(CRITERIA) >= {"dang_van", "crossland", "findley", "matake", "fatemi_socie"}


def test_an_edge_crack_has_the_intensity_of_handbooks() -> None:
    """Constant stress 1.1215, falling to zero at the tip .4390 (Tada, Paris, Irwin): to .5 %."""
    depth, a = np.linspace(0.0, 3.0, 301), np.array([0.5, 2.0])
    constant = stress_intensity(depth, np.full(301, 100.0), a) / (100 * np.sqrt(np.pi * a))
    np.testing.assert_allclose(constant, 1.12152, rtol=1e-4)
    rising = stress_intensity(depth, 100 * depth, a) / (100 * a * np.sqrt(np.pi * a))
    np.testing.assert_allclose(constant - rising, 0.4390, rtol=5e-3)


def test_a_residual_compression_closes_a_crack_and_holds_it() -> None:
    """Tension of 100 MPa opens it; 300 MPa of compression below .2 mm closes the longer ones."""
    depth, a = np.linspace(0.0, 3.0, 301), np.linspace(0.05, 2.0, 40)
    load = np.full(301, 100.0)
    residual = np.where(depth > 0.2, -300.0, 0.0)
    largest, smallest = stress_intensity(depth, np.stack([load + residual, residual]), a)
    opened = opened_range(largest, smallest)
    assert (smallest <= 1e-9).all() and opened[0] == pytest.approx(largest[0])
    assert opened[-1] == 0.0 and largest[-1] < 0
    stop, least = arrest(a, opened, 20.0)
    assert 0.2 < stop < 0.6 and least == 0.0
    assert np.interp(stop, a, opened) == pytest.approx(20.0)
    alone = stress_intensity(depth, load, a)
    stop, least = arrest(a, alone, 20.0)
    assert stop == np.inf and least == alone[0]
    with pytest.raises(ModelError, match="lengths"):
        stress_intensity(depth, load, np.array([4.0]))


@pytest.mark.parametrize(
    ("opened", "expected"),
    [
        ([9, 7, 3, 8], (2.5, 3)),  # 5 lies halfway from 7 to 3
        ([5, 4, 8, 8], (1.0, 4)),  # begins at the threshold, then falls
        ([4, 9, 3, 8], (1.0, 3)),  # never grows
        ([9, 7, 8, 5], (np.inf, 5)),  # never stops
        ([9, 7, np.nan, 1], (np.nan, 7)),  # not known before it stops
        ([9, 4, np.nan, 9], (1.8, 4)),  # stops before
        ([np.nan, 7, 1, 1], (np.nan, np.nan)),
    ],
)
def test_a_crack_stops_at_the_first_known_length_below_the_threshold(
    opened: list[float], expected: tuple[float, float]
) -> None:
    found = arrest(np.arange(1.0, 5.0), np.array(opened, dtype=float), 5.0)
    assert found == pytest.approx(expected, nan_ok=True)


def test_rolling_indices_have_their_limits_where_the_sources_have_them() -> None:
    k, p0 = 240.0, np.array([480.0, 1200.0])
    np.testing.assert_allclose(surface_index(np.array([0.5, 0.3]), p0, k), [0.0, 0.1])
    np.testing.assert_allclose(subsurface_index(np.zeros(2), p0), p0 / 6)
    assert subsurface_index(np.zeros(1), p0, -30.0)[0] == pytest.approx(70.0)
    energy = t_gamma((np.array([1000.0]), np.array([-500.0])), (np.array([0.01]), np.array([0.02])))
    assert energy[0] == pytest.approx(20.0)
    found = crack_damage(np.array([10.0, 15.0, 40.0, 65.0, 175.0, 285.0]))
    np.testing.assert_allclose(found, [0.0, 0.0, 5e-6, 1e-5, 0.0, -1e-5], atol=1e-18)


def test_a_criterion_that_takes_the_smaller_of_two_values_has_both() -> None:
    """Tension 50 sin t with shear 100 sin t: the best of many planes has 83.9."""
    course = np.sin(np.linspace(0.0, 2 * np.pi, 61))
    stress = np.zeros((1, 61, 6))
    stress[0, :, 0], stress[0, :, 3] = 50.0 * course, 100.0 * course
    found = critical_planes(Paths(stress), lambda on: np.minimum(on.shear, on.normal_half))
    least = min(found.on.shear.item(), found.on.normal_half.item())
    assert 0.98 * 83.9 < least < 84.5


def test_no_plane_is_farther_from_those_of_the_scan_than_the_bound_says() -> None:
    rng = np.random.default_rng(3)
    largest, width = 0.0, 1.0
    normals = rng.standard_normal((100_000, 3))
    for _ in range(6):
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        angle = np.arccos(np.minimum(np.abs(normals @ _NORMALS.T).max(axis=1), 1.0))
        largest = max(largest, float(angle.max()))
        width /= 4
        far = normals[np.argsort(-angle)[:200]]
        normals = (far[:, None] + width * rng.standard_normal((200, 100, 3))).reshape(-1, 3)
    assert 0.1355 < largest
    assert 2 * np.sin(largest) ** 2 < _FALLS


@pytest.mark.parametrize("count", [2, 3, 5, 40])
def test_amplitudes_of_shear_are_radii_of_smallest_balls(count: int) -> None:
    """Instants repeat, as where a cycle begins and ends at rest."""
    rng = np.random.default_rng(count)
    stress = rng.normal(size=(300, count, 6)).repeat(2, axis=1)
    normal = rng.normal(size=(300, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    shear = acting(
        searching(Paths(stress), Findley(torsion=1.0, sensitivity=0.2).on_plane), normal
    ).shear
    traction = stress[:, :, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]] @ normal[:, None, :, None]
    along = traction[..., 0] - (traction[..., 0] @ normal[:, :, None]) * normal[:, None]
    _, radii = balls(np.ascontiguousarray(along.swapaxes(1, 2)))
    np.testing.assert_allclose(shear, radii, rtol=1e-9)


@pytest.mark.parametrize("count", [10, 38])
def test_shear_of_three_instants_nearly_at_two_places_is_not_rounding(count: int) -> None:
    """Principal stresses a third of a cycle apart: planes whose path is almost a straight line."""
    turns = np.linspace(0, 2 * np.pi, count)[:, None] + np.array([0, 2, 4]) * np.pi / 3
    stress = np.concatenate([100 * np.sin(turns), np.zeros((count, 3))], axis=1)[None]
    criterion = Matake(torsion=1.0, sensitivity=0.2)
    found = critical_planes(Paths(stress), criterion.searched, criterion.on_plane)
    traction = stress[0][:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]] @ found.normal[0]
    along = traction - (traction @ found.normal[0])[:, None] * found.normal[0]
    _, radius = balls(np.ascontiguousarray(along.T[None]))
    np.testing.assert_allclose(found.on.shear, radius, rtol=1e-9)


@pytest.mark.parametrize("unit", [1e-25, 1e25])
def test_planes_do_not_depend_on_the_unit_of_stress(unit: float) -> None:
    stress = np.random.default_rng(3).normal(size=(20, 9, 6))
    criterion = Findley(torsion=352.0, sensitivity=0.2)
    own, other = (criterion.assess(Paths(u * stress)) for u in (1.0, unit))
    np.testing.assert_allclose(other.value, unit * own.value, rtol=1e-9)
    np.testing.assert_allclose(other.plane, own.plane, atol=1e-6)
