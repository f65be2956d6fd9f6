"""What the figures show."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.plots import figure, line_figure, map_figure
from tests.studies.conftest import compute_here, fake_study

ComputedStudy = tuple[Study, Store]


def mesh_of(sheet: Figure) -> tuple[Axes, QuadMesh]:
    axes = sheet.axes[0]
    (mesh,) = (each for each in axes.collections if isinstance(each, QuadMesh))
    return axes, mesh


def test_a_stress_map_has_zero_in_the_middle_of_its_colours(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        sheet = map_figure(together, "residual_stress", "xx")
    axes, mesh = mesh_of(sheet)
    low, high = mesh.get_clim()
    assert low == -high < 0.0
    assert axes.get_aspect() == 1.0
    assert sheet.axes[1].get_ylabel() == "residual stress [MPa]"
    words = " ".join(text.get_text() for text in axes.texts) + axes.get_title(loc="left")
    assert "Residual stress, xx" in words
    assert "load ratio 0.9" in words
    assert "friction 0.4" in words


def test_a_strain_map_begins_at_zero_and_leaves_nothing_out(computed: ComputedStudy) -> None:
    study, store = computed
    case = next(study.cases())
    with open_netcdf(store.run_path(case.id)) as run:
        _, mesh = mesh_of(map_figure(run, "plastic_strain"))
        values = run["plastic_strain"].squeeze().to_numpy()
    assert mesh.get_clim()[0] == 0.0
    drawn = mesh.get_array()
    assert drawn is not None
    np.testing.assert_array_equal(np.asarray(drawn), values)


def test_zoom_shows_the_neighbourhood_of_the_edge(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        axes, _ = mesh_of(map_figure(together, zoom=30.0))
    half_cell = 12.5
    low, high = axes.get_xlim()
    assert 50.0 - 30.0 - half_cell <= low < 50.0 < high <= 50.0 + 30.0 + half_cell


def test_a_pressure_figure_has_a_line_for_each_stage(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        axes = line_figure(together, "contact_pressure").axes[0]
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["loaded", "unloaded"]
    assert axes.get_ylabel() == "contact pressure [MPa]"


def test_figure_chooses_what_suits_the_field(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        assert len(figure(together, "residual_stress").axes) == 2
        assert len(figure(together, "contact_pressure").axes) == 1
        with pytest.raises(StudyError) as caught:
            figure(together, "increments")
        assert "contact_pressure" in caught.value.allowed


def test_a_field_that_is_zero_everywhere_is_drawn(store: Store) -> None:
    study = fake_study(sweep={"friction": [0.0]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        together["residual_stress"] = 0.0 * together["residual_stress"]
        together["plastic_strain"] = 0.0 * together["plastic_strain"]
        for field in ("residual_stress", "plastic_strain"):
            low, high = mesh_of(map_figure(together, field))[1].get_clim()
            assert low < high
