"""The real punch over HTTP: what arrives is what a local run gives."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from studies import Store, Study, open_netcdf, open_study, run_study
from studies.storage.ran import MEANINGS
from tests.service.servers import COARSE_PUNCH, Server

pytestmark = pytest.mark.usefixtures("one_worker")

STUDY = {
    "name": "acceptance",
    "scene": "punch",
    "parameters": COARSE_PUNCH,
    "sweep": {"load_ratio": [0.4, 0.7], "friction": [0.0, 0.3]},
}


@pytest.fixture(scope="module")
def posted(service: Server) -> dict[str, Any]:
    """The study, accepted; it is computed while the tests go on."""
    return service.study(service.post(STUDY))


def test_a_posted_study_gives_the_data_set_of_a_local_run_bit_for_bit(
    service: Server, posted: dict[str, Any], tmp_path: Path
) -> None:
    study = Study.from_dict(STUDY)
    outcome = run_study(study, Store(tmp_path / "local"), workers=1)
    assert outcome.counts == {"ok": 4}
    found = service.finished(posted["id"])
    assert (found["id"], found["counts"]) == (study.id, outcome.counts)
    fetched = tmp_path / "fetched.nc"
    fetched.write_bytes(service.client.get(f"/studies/{study.id}/dataset.nc").content)
    with open_netcdf(fetched) as ours, open_study(tmp_path / "local") as local:
        assert set(ours.variables) == set(local.variables)
        for name in set(local.variables) - {"cpu_seconds", *MEANINGS}:
            assert ours[name].dims == local[name].dims
            assert ours[name].attrs.keys() == local[name].attrs.keys()
            np.testing.assert_array_equal(ours[name], local[name], err_msg=str(name))
        assert float(abs(local["residual_stress"]).max()) > 1.0, "some run yields"
        differ = {key for key in local.attrs if ours.attrs.get(key) != local.attrs[key]}
        assert ours.attrs.keys() == local.attrs.keys() and differ <= {"created", "history"}


def test_figures_that_count_are_whole_numbers(service: Server, posted: dict[str, Any]) -> None:
    run = service.finished(posted["id"])["runs"][-1]
    for answer in (
        service.client.get(f"/runs/{run['id']}").json(),
        service.client.get("/runs", params={"scene": "punch"}).json()["items"][-1],
    ):
        figures = answer["scalars"]
        counts = {name for name, figure in figures.items() if isinstance(figure, int)}
        assert {"increments", "iterations", "degrees_of_freedom"} <= counts
        assert isinstance(figures["contact_half_width"], float)


def test_a_map_zooms_to_the_edge_of_the_contact(service: Server, posted: dict[str, Any]) -> None:
    run = service.finished(posted["id"])["runs"][-1]
    url = f"/runs/{run['id']}/map.png"
    whole, near = (service.client.get(url, params=query) for query in ({}, {"zoom": 10}))
    assert (whole.status_code, near.status_code) == (200, 200), near.text
    pictures = [
        matplotlib.image.imread(io.BytesIO(each.content), format="png") for each in (whole, near)
    ]
    assert all(picture[..., :3].std() > 0.05 for picture in pictures)
    assert whole.content != near.content
