"""Laws beyond linear hardening of von Mises: closed forms, and references that share no code."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partialmethod

import numpy as np
import pytest

from solver import (
    Body,
    LimitLoad,
    Model,
    ModelError,
    NotConverged,
    PathControl,
    Tolerances,
    solve,
)
from solver.materials import (
    ArmstrongFrederick,
    Chaboche,
    Elasticity,
    Layered,
    Material,
    PlaneStress,
    SmoothMaterial,
    Table,
    TrescaMaterial,
    Voce,
)
from solver.materials.hardening_rules import HARDENING
from solver.materials.yield_surface import Tresca, VonMises
from solver.mesh import grid
from solver.tensors import identity
from tests.solver.laws import CURVES, LAYERED, SOFT, STEEL, SURFACES, chaboche, steel
from tests.solver.yield_surfaces import Hosford

FIELDS = ("elasticity", "curve", "back_stresses")
RE, E, G = 350.0, 2e5, STEEL.shear_modulus


def uniaxial(law, strains):
    """Stress (n,) of a tension test that follows these strains, and the last state."""
    strain, state = np.zeros((4, 1)), law.initial(1, 4)
    stresses = []
    for axial in strains:
        strain[0] = axial
        for _ in range(50):  # nothing holds the bar across, where it contracts alike
            found = law.respond(strain, state)
            if abs(found.stress[1, 0]) < 1e-9:
                break
            strain[1:3, 0] -= found.stress[1, 0] / found.tangent[1, 1:3, 0].sum()
        assert abs(found.stress[1, 0]) < 1e-9
        state = found.state
        stresses.append(found.stress[0, 0])
    return np.array(stresses), state


# -- Tresca ------------------------------------------------------------------------------------

_PI_PLANE = np.array([[1.0, -1.0, 0.0], [-1.0, -1.0, 2.0]])
_PI_PLANE /= np.linalg.norm(_PI_PLANE, axis=1)[:, None]


def _hexagon():
    """The corners (6, 2) of Tresca's hexagon of size RE in the pi-plane, by angle."""
    corners = [sign * np.roll([2.0, -1.0, -1.0], k) for k in range(3) for sign in (1, -1)]
    flat = np.array(corners) * RE / 3 @ _PI_PLANE.T
    return flat[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))]


def _nearest(point):
    """The point of the hexagon that is nearest to one outside."""
    found = []
    for a, b in itertools.pairwise([*_hexagon(), _hexagon()[0]]):
        share = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        found.append(a + share * (b - a))
    return min(found, key=lambda p: np.linalg.norm(p - point))


def test_tresca_returns_to_the_nearest_point_of_its_hexagon():
    law = TrescaMaterial(elasticity=STEEL, curve=SOFT)
    angles = np.linspace(0, 2 * np.pi, 73)[:-1] + 0.013
    trial = 2.5 * RE * np.stack([np.cos(angles), np.sin(angles)])
    strain = np.zeros((6, len(angles)))
    strain[:3] = _PI_PLANE.T @ trial / (2 * G)
    found = law.respond(strain, law.initial(len(angles), 6))
    assert found.yielding.all()
    wanted = np.array([_nearest(p) for p in trial.T])
    assert _PI_PLANE @ found.stress[:3] == pytest.approx(wanted.T, abs=1e-9 * RE)
    corners = (np.linalg.norm(wanted[:, None] - _hexagon()[None], axis=2).min(axis=1) < 1e-9).sum()
    assert 10 < corners < 60  # both faces and edges were met


def test_tresca_in_plane_stress_yields_on_its_hexagon():
    law = PlaneStress(TrescaMaterial(elasticity=STEEL, curve=SOFT))
    angles = np.linspace(0, 2 * np.pi, 73)[:-1] + 0.013
    strain = np.zeros((4, len(angles)))
    state = law.initial(len(angles), 4)
    for size in np.linspace(0.2, 3, 15):
        strain[:2] = size * RE / E * np.stack([np.cos(angles), np.sin(angles)])
        found = law.respond(strain, state)
        state = found.state
    a, b = found.stress[:2]
    size = np.max([np.abs(a), np.abs(b), np.abs(a - b)], axis=0)
    assert size == pytest.approx(np.full(len(angles), RE), rel=1e-9)


def test_principal_stresses_turned_give_the_same_response_turned():
    law = TrescaMaterial(elasticity=STEEL, curve=CURVES["voce"])
    rng = np.random.default_rng(4)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    straight = np.diag([0.006, -0.001, -0.004])
    both = [straight, turn @ straight @ turn.T]
    strain = np.stack([_mandel(each) for each in both], axis=1)
    found = law.respond(strain, law.initial(2, 6))
    stress = _mandel(turn @ _full(found.stress[:, 0]) @ turn.T)
    assert stress == pytest.approx(found.stress[:, 1], abs=1e-9)


def _mandel(tensor):
    off = np.sqrt(2) * np.array([tensor[0, 1], tensor[1, 2], tensor[2, 0]])
    return np.concatenate([np.diag(tensor), off])


def _full(mandel):
    a, b, c = mandel[3:] / np.sqrt(2)
    return np.diag(mandel[:3]) + np.array([[0, a, c], [a, 0, b], [c, b, 0]])


@pytest.mark.parametrize("n", [4, 6])
@pytest.mark.parametrize("strain", [(0.01, -0.005, -0.005), (0.005, 0.005, -0.01)])
def test_the_tangent_is_right_where_two_trial_stresses_are_the_same(n, strain):
    law = TrescaMaterial(elasticity=STEEL, curve=CURVES["linear"])
    at, state = np.zeros((n, 1)), law.initial(1, n)
    at[:3, 0] = strain
    h = 1e-8
    steps = h * np.eye(n)[:, :, None]
    change = [law.respond(at + s, state).stress - law.respond(at - s, state).stress for s in steps]
    difference = np.stack([each[:, 0] for each in change], axis=1) / (2 * h)
    assert np.abs(difference - law.respond(at, state).tangent[:, :, 0]).max() < 1e-5 * E


@pytest.mark.parametrize(
    ("stress", "flow", "right"),
    [
        ((200.0, 20.0, -150.0), (1.0, 0.0, -1.0), True),
        ((200.0, 20.0, -150.0), (1.0, 0.0, -0.3), False),  # does not keep the volume
        ((200.0, 20.0, -150.0), (1.0, -0.4, -0.6), False),  # off the face
        ((200.0, 20.0, -150.0), (-1.0, 0.0, 1.0), False),
        ((350.0, 0.0, 0.0), (1.0, -0.4, -0.6), True),  # between two normals
        ((350.0, 0.0, 0.0), (1.0, -1.0, 0.0), True),
        ((350.0, 0.0, 0.0), (1.0, -0.5, 0.0), False),
        ((350.0, 0.0, 0.0), (1.0, -1.0, -1.0), False),
        ((350.0, 0.0, 0.0), (1.0, 0.5, -1.5), False),
        ((350.0, 0.0, 0.0), (1.0, 1.0, -2.0), False),
        ((350.0, 0.0, 0.0), (1.0, -2.0, 1.0), False),
    ],
)
def test_only_flow_between_the_normals_of_tresca_is_associated(stress, flow, right):
    dp = 0.01
    rng = np.random.default_rng(3)
    for _ in range(5):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        tensors = [_mandel(turn @ np.diag(v) @ turn.T)[:, None] for v in (stress, flow)]
        flow_rule_error = Tresca().flow_rule_error(
            tensors[0], dp * tensors[1], np.array([dp]), 2 * G
        )[0]
        assert (flow_rule_error < 1e-9) if right else (flow_rule_error > 0.1 * dp)


def test_a_return_asks_its_curve_a_few_times():
    asked = []

    class Counting(Voce):
        def flow_stress(self, accumulated):
            asked.append(accumulated.shape)
            return Voce.flow_stress(self, accumulated)

    law = TrescaMaterial(elasticity=STEEL, curve=Counting(yield_stress=RE, saturation=100, rate=50))
    strain = 5e-3 * np.random.default_rng(2).standard_normal((6, 500))
    assert law.respond(strain, law.initial(500, 6)).yielding.sum() > 300
    assert len(asked) < 25


# -- curves ------------------------------------------------------------------------------------


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("make", [TrescaMaterial, Chaboche])
def test_tension_follows_the_curve(make, curve):
    law = make(elasticity=STEEL, curve=CURVES[curve])
    stress, state = uniaxial(law, np.linspace(0.001, 0.03, 30))
    plastic = 0.03 - stress[-1] / E
    assert state.accumulated[0] == pytest.approx(plastic, rel=1e-9)
    assert stress[-1] == pytest.approx(CURVES[curve].flow_stress(plastic), rel=1e-9)
    assert law.hardens == (curve in ("linear", "power"))
    last = CURVES[curve].flow_stress(np.array([1e3]))[0]
    assert law.ultimate_shear_stress == (
        np.inf if law.hardens else pytest.approx(law.surface.shear(last), rel=1e-9)
    )


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Voce(yield_stress=0.0), "yield_stress"),
        (lambda: Voce(yield_stress=RE, rate=0.0), "rate"),
        (lambda: Voce(yield_stress=RE, saturation=-1.0), "saturation"),
        (lambda: Voce(yield_stress=RE, modulus=float("nan")), "modulus"),
        (lambda: Table(plastic_strain=(0.0, 0.1), stress=(1.0,)), "table"),
        (lambda: Table(plastic_strain=(0.1, 0.2), stress=(1.0, 2.0)), "table.plastic_strain"),
        (lambda: Table(plastic_strain=(0.0, 0.2), stress=(2.0, 1.0)), "table.stress"),
        (lambda: ArmstrongFrederick(-1.0), "modulus"),
        (lambda: ArmstrongFrederick(1.0, np.inf), "recall"),
        (lambda: Layered(elasticity=STEEL, weights=(0.5,), yields=(1.0, 2.0)), "layers"),
        (lambda: Layered(elasticity=STEEL, weights=(0.5, 0.6), yields=(1.0, 2.0)), "weights"),
        (lambda: Layered(elasticity=STEEL, weights=(0.5, 0.5), yields=(2.0, 1.0)), "yields"),
        (lambda: Layered.of_curve(STEEL, (0.002,), (RE,)), "curve.strain"),
        (lambda: Layered.of_curve(STEEL, (RE / E, 0.01, 0.02), (RE, 400.0, 500.0)), "curve.stress"),
    ],
)
def test_wrong_numbers_are_refused_by_name(make, field):
    with pytest.raises(ModelError) as refusal:
        make()
    assert refusal.value.field == field


@pytest.mark.parametrize("word", ["none", "isotropic", "kinematic", "mixed", "material"])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("youngs_modulus", 0.0),
        ("youngs_modulus", np.nan),
        ("youngs_modulus", "2e5"),
        ("poisson_ratio", -0.1),
        ("poisson_ratio", 0.5),
    ],
)
def test_no_law_takes_elastic_constants_out_of_their_range(word, name, value):
    given = {"youngs_modulus": E, "poisson_ratio": 0.3} | {name: value}
    with pytest.raises(ModelError) as refusal:
        if word == "material":
            Material(**given)
        else:
            HARDENING.all()[word]().law(Elasticity(**given), RE)
    assert (refusal.value.field, str(refusal.value.value)) == (name, str(value))


@pytest.mark.parametrize("kind", [Chaboche, TrescaMaterial, SmoothMaterial, Material])
def test_a_law_of_parts_is_not_rigid(kind):
    parts = {"elasticity": Elasticity(youngs_modulus=np.inf, poisson_ratio=0.3), "curve": SOFT}
    parts |= {"surface": Hosford(8.0)} if kind is SmoothMaterial else {}
    given = {"youngs_modulus": np.inf, "poisson_ratio": 0.3} if kind is Material else parts
    with pytest.raises(ModelError, match=r"youngs_modulus = inf: must be (a )?finite"):
        kind(**given)


# -- back stresses -----------------------------------------------------------------------------


def of_parts(like, saturation=0.0):
    """The law of a material, written in parts."""
    return Chaboche(
        elasticity=STEEL,
        curve=Voce(yield_stress=RE, modulus=like.isotropic_modulus, saturation=saturation),
        back_stresses=(ArmstrongFrederick(like.kinematic_modulus),),
    )


def test_parts_that_harden_linearly_respond_in_closed_form():
    like = steel("mixed")
    law = of_parts(like)
    assert law.linear_hardening is not None
    assert law.linear_hardening == like.linear_hardening
    assert law.initial(3, 4).packed.shape == like.initial(3, 4).packed.shape
    assert _differ(law, like, 6) == 0.0
    other = ArmstrongFrederick(1000.0, 1.0)
    own = type("Own", (Voce,), {})(yield_stress=RE)
    for change in ({"curve": CURVES["voce"]}, {"curve": own}, {"back_stresses": (other,)}):
        assert replace(law, **change).linear_hardening is None


@pytest.mark.parametrize("name", ["surface", "respond", "flow_stress", "back_stress"])
def test_a_law_of_ones_own_that_changes_a_part_has_no_closed_form(name):
    parts = {field: getattr(of_parts(steel("mixed")), field) for field in FIELDS}
    own = property(lambda law: type("Own", (VonMises,), {})())
    if name != "surface":
        own = partialmethod(getattr(Chaboche, name))
    assert type("Own", (Chaboche,), {})(**parts).linear_hardening is not None
    assert type("Own", (Chaboche,), {name: own})(**parts).linear_hardening is None


def test_a_rule_derived_from_armstrong_and_frederick_evolves_by_itself():
    still = type("Still", (ArmstrongFrederick,), {"evolve": lambda rule, old, *given: old})
    law = chaboche("fading", "voce")
    moving, alone = replace(law, back_stresses=(still(5e4, 300.0),)), replace(law, back_stresses=())
    assert _differ(moving, alone, 6) < 1e-12


def test_one_back_stress_that_does_not_fade_is_pragers():
    like = steel("mixed")
    law = of_parts(like, saturation=1e-9)
    assert law.linear_hardening is None
    assert _differ(law, like, 6) < 1e-12


def test_ratchetting_between_two_stresses_is_that_of_armstrong_and_frederick():
    # on a half-cycle X goes to C / gamma (1 - exp(-gamma |plastic strain|)) about where it began
    C, gamma, top, bottom = 60_000.0, 300.0, 480.0, -380.0
    law = Chaboche(elasticity=STEEL, curve=SOFT, back_stresses=(ArmstrongFrederick(C, gamma),))
    end = C / gamma
    up, down = top - RE, bottom + RE
    first = np.log(end / (end - up)) / gamma
    back = np.log((end + up) / (end + down)) / gamma
    again = np.log((end - down) / (end - up)) / gamma
    found = [_cycles(law, top, bottom, 3, steps) for steps in (160, 320)]
    strain = 2 * found[1] - found[0]  # backward Euler is of first order
    plastic = np.array([first, first - back])
    plastic = np.append(plastic, [first - back + again, first - 2 * back + again])
    assert again > back > 0
    assert strain[:4] == pytest.approx(plastic, rel=5e-4)
    assert np.diff(strain[1::2]) == pytest.approx(again - back, rel=2e-3)


def test_in_a_closed_cycle_all_work_becomes_heat():
    law = chaboche("fading", "none")
    turns = np.array([0.02, -0.02] * 3)
    strain, state, now = np.zeros((4, 1)), law.initial(1, 4), 0.0
    stress = np.zeros((4, 1))
    work, heat = np.zeros(len(turns)), np.zeros(len(turns))
    for k, end in enumerate(turns):
        for shear in np.linspace(now, end, 401)[1:]:
            step = shear - strain[3, 0]
            strain[3] = shear
            found = law.respond(strain, state)
            work[k] += 0.5 * (stress[3, 0] + found.stress[3, 0]) * step
            heat[k] += law.dissipation(state, found)[0]
            state, stress = found.state, found.stress
        now = end
    assert heat[-2:].sum() == pytest.approx(work[-2:].sum(), rel=0.01)


def _cycles(law, top, bottom, count, steps):
    """Plastic strain (2 count,) in tension at the end of each half-cycle between two stresses."""
    strain, state = np.zeros((4, 1)), law.initial(1, 4)
    found, now = [], 0.0
    for end in [top, bottom] * count:
        for wanted in np.linspace(now, end, steps + 1)[1:]:
            for _ in range(200):
                response = law.respond(strain, state)
                off = response.stress[:, 0] - [wanted, 0, 0, 0]
                if np.abs(off).max() < 1e-8:
                    break
                strain[:, 0] -= np.linalg.solve(response.tangent[:, :, 0], off)
            assert np.abs(off).max() < 1e-8
            state = response.state
        now = end
        found.append(state.plastic_strain[0, 0])
    return np.array(found)


def _explicit(law, path, steps):
    """Stress after straight strain paths, by many forward steps of the rates."""
    n = path[0].shape[1]
    C = law.stiffness(6)
    strain, flow, p = np.zeros((6, n)), np.zeros((6, n)), np.zeros(n)
    rules = [(rule.modulus, rule.recall) for rule in law.back_stresses]
    back = np.zeros((len(rules), 6, n))
    dev = np.eye(6)
    dev[:3, :3] -= 1 / 3
    for end in path:
        step = (end - strain) / steps
        for _ in range(steps):
            strain = strain + step
            xi = dev @ (C @ (strain - flow)) - back.sum(axis=0)
            q = np.sqrt(1.5 * (xi**2).sum(axis=0))
            normal = 1.5 * xi / q
            fade = [c - g * (normal * x).sum(axis=0) for (c, g), x in zip(rules, back, strict=True)]
            slope = 3 * G + sum(fade) + law.curve.slope(p)
            dp = np.maximum(q - law.curve.flow_stress(p), 0.0) / slope
            flow, p = flow + dp * normal, p + dp
            back = np.stack(
                [
                    x + 2 / 3 * c * dp * normal - g * x * dp
                    for (c, g), x in zip(rules, back, strict=True)
                ]
            )
    return C @ (strain - flow)


def test_random_paths_in_small_steps_are_those_of_the_rates():
    law = chaboche("fading")
    rng = np.random.default_rng(7)
    path = [4e-3 * rng.standard_normal((6, 20)) for _ in range(3)]
    wanted = _explicit(law, path, 4000)
    errors = []
    for steps in (100, 200):
        state, before = law.initial(20, 6), np.zeros((6, 20))
        for end in path:
            for k in range(1, steps + 1):
                found = law.respond(before + (end - before) * k / steps, state)
                state = found.state
            before = end
        errors.append(np.abs(found.stress - wanted).max())
    assert errors[1] < 2e-3 * RE
    assert errors[0] / errors[1] > 1.7  # of first order


# -- layers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [4, 6])
def test_layers_of_a_bilinear_curve_are_pragers(n):
    like = steel("kinematic")
    law = Layered.of_curve(STEEL, (RE / E,), (RE,), slope=0.024 * E)
    H = like.plastic_modulus
    assert law.elastic_weight == pytest.approx(H / (3 * G + H), rel=1e-12)
    assert _differ(law, like, n) < 1e-12


def _differ(law, like, n):
    """The largest difference of stress and tangent of two laws on a random path."""
    rng = np.random.default_rng(11)
    strain = np.zeros((n, 200))
    states, worst = [law.initial(200, n), like.initial(200, n)], 0.0
    for _ in range(6):
        strain = strain + 3e-3 * rng.standard_normal(strain.shape)
        one, other = law.respond(strain, states[0]), like.respond(strain, states[1])
        states = [one.state, other.state]
        worst = max(worst, np.abs(one.stress - other.stress).max() / np.abs(other.stress).max())
        worst = max(worst, np.abs(one.tangent - other.tangent).max() / E)
        assert one.yielding.sum() > 100
    return worst


def test_layers_follow_the_curve_and_after_reversal_twice_the_curve():
    strain, stress = np.array([RE / E, 0.003, 0.01]), np.array([350.0, 430.0, 500.0])
    steps = np.linspace(0.0005, 0.012, 24)
    found, _ = uniaxial(LAYERED, steps)
    curve = np.interp(steps, [0, *strain], [0, *stress]) + 2000.0 * np.maximum(steps - 0.01, 0)
    assert found == pytest.approx(curve, rel=1e-9)
    back = 0.012 - np.linspace(0.0005, 0.018, 36)
    both, _ = uniaxial(LAYERED, [*steps, *back])
    half = (0.012 - back) / 2
    masing = np.interp(half, [0, *strain], [0, *stress]) + 2000.0 * np.maximum(half - 0.01, 0)
    assert both[len(steps) :] == pytest.approx(both[len(steps) - 1] - 2 * masing, rel=1e-8)


def test_layers_without_an_elastic_one_have_an_ultimate_stress():
    law = Layered.of_curve(STEEL, (RE / E, 0.004), (RE, 430.0))
    stress, _ = uniaxial(law, np.linspace(0.001, 0.02, 20))
    assert stress[-1] == pytest.approx(430.0, rel=1e-9)
    assert not law.hardens
    assert law.elastic_weight == 0.0
    assert law.ultimate_shear_stress == pytest.approx(
        np.dot(law.weights, law.yields) / np.sqrt(3), rel=1e-12
    )


def test_a_wrong_layer_is_a_misfit_even_if_the_sum_is_right():
    strain = np.zeros((4, 3))
    strain[3] = 0.01
    before = LAYERED.initial(3, 4)
    stress, _, after, _ = LAYERED.respond(strain, before)
    moved = after.layer_strain.copy()
    moved[0, 3] += 1e-4 / LAYERED.weights[0]
    moved[1, 3] -= 1e-4 / LAYERED.weights[1]
    wrong = replace(after, layer_strain=moved)
    assert LAYERED.misfit(strain, stress, before, after).max() < 1e-9
    assert LAYERED.misfit(strain, stress, before, wrong).min() > 1.0


def test_layers_of_a_material_without_lateral_contraction_follow_the_curve():
    elasticity = Elasticity(youngs_modulus=E, poisson_ratio=0.0)
    law = Layered.of_curve(elasticity, (RE / E, 0.01), (RE, 450.0), slope=100.0)
    stress, _ = uniaxial(law, np.linspace(0.001, 0.01, 10))
    assert stress[-1] == pytest.approx(450.0, rel=1e-9)


@pytest.mark.solves
@pytest.mark.parametrize(
    ("pull", "iterations", "ends"), [(300.0, 2, NotConverged), (420.0, 40, LimitLoad)]
)
def test_only_a_curve_at_its_end_proves_a_limit_load(pull, iterations, ends):
    """Soft but still hardening, a failed increment has another reason."""
    law = Chaboche(elasticity=STEEL, curve=Voce(yield_stress=100.0, saturation=300.0, rate=8.0))
    bar = Body(name="bar", mesh=grid(np.linspace(0.0, 2.0, 3), np.linspace(0.0, 1.0, 3)),
               material=law, kinematics="plane_stress", supports={"left": "x", "bottom": "y"},
               pressure={"right": -pull})  # fmt: skip
    control = PathControl(load_step=0.5, tolerances=Tolerances(iterations=iterations))
    with pytest.raises(NotConverged) as caught:
        solve(Model(bodies=(bar,)), control=control)
    assert type(caught.value) is ends


IDEAL = TrescaMaterial(
    elasticity=STEEL, curve=Voce(yield_stress=RE, saturation=0.0, rate=1.0)
)  # fmt: skip


@pytest.mark.solves
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
def test_a_bar_of_tresca_ends_at_its_limit_load(kinematics):
    """Stress is on an edge; the kinematic theorem proves the limit, which is the yield stress."""
    x = np.linspace(0.0, 4.0, 5)
    bar = Body(name="bar", mesh=grid(x, x), material=IDEAL, kinematics=kinematics,
               supports={"left": "x", "bottom": "y"}, pressure={"top": -RE})  # fmt: skip
    with pytest.raises(LimitLoad, match="body 'bar' flows") as caught:
        solve(Model(bodies=(bar,)), load=1.3)
    assert caught.value.reached < 1.0 < caught.value.attempted < 1.01


@pytest.mark.solves
def test_a_tube_of_tresca_ends_at_its_limit_load():
    """Under a pressure of RE ln(outer / inner radius)."""
    tube = Body(name="tube", mesh=grid(np.linspace(10.0, 20.0, 9), np.array([0.0, 1.0, 2.0])),
                material=IDEAL, kinematics="axisymmetric", supports={"bottom": "y", "top": "y"},
                pressure={"left": RE * np.log(2.0)})  # fmt: skip
    with pytest.raises(LimitLoad, match="body 'tube' flows") as caught:
        solve(Model(bodies=(tube,)), load=1.3)
    # the last point to yield is not at the outer side
    assert 0.99 < caught.value.reached < caught.value.attempted < 1.01


@pytest.mark.solves
def test_an_increment_given_up_below_the_limit_proves_none():
    """At three quarters of the limit load, after two iterations."""
    tube = Body(name="tube", mesh=grid(np.linspace(10.0, 20.0, 9), np.array([0.0, 1.0, 2.0])),
                material=IDEAL, kinematics="axisymmetric", supports={"bottom": "y", "top": "y"},
                pressure={"left": RE * np.log(2.0)})  # fmt: skip
    for load in (0.75, 0.99):
        control = PathControl(load_step=1.0, max_cuts=0, tolerances=Tolerances(iterations=2))
        with pytest.raises(NotConverged) as caught:
            solve(Model(bodies=(tube,)), load=load, control=control)
        assert type(caught.value) is NotConverged


@pytest.mark.parametrize("surface", [VonMises(), Tresca(), *SURFACES.values(), Hosford(100.0)])
def test_no_stress_inside_does_more_work_than_the_power_of_its_surface(surface):
    """And the stress of flow along the strain does as much."""
    rng = np.random.default_rng(1864)
    stress, strain = rng.normal(size=(2, 4, 500))
    stress /= surface.equivalent(stress)
    strain -= identity(4)[:, None] * strain[:3].sum(axis=0) / 3
    assert ((stress * strain).sum(axis=0) <= surface.power(strain) * (1 + 1e-12)).all()
    flow = surface.normal(stress)
    assert surface.power(flow) == pytest.approx((stress * flow).sum(axis=0))
