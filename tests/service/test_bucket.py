"""The service on a store at an address of fsspec."""

from __future__ import annotations

import csv
import io
import uuid
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from studies import Store, run_study
from studies.storage.blobs import directory_of
from studies.storage.seal import check_content
from studies.views.reading import loaded
from tests.studies.conftest import fake_study


@pytest.mark.parametrize("scheme", ["memory:/", "file:/"])
@pytest.mark.usefixtures("computing_here")
def test_a_study_at_an_address_is_served(
    scheme: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = f"{scheme}{tmp_path}/{uuid.uuid4().hex}"
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path / "here"))
    study = fake_study(sweep={"friction": [0.0, 0.2]})
    run_study(study, Store(address), workers=0)
    run = next(iter(study.run_ids()))
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path / "elsewhere"))
    monkeypatch.setenv("RESIDUA_DATA", address)
    settings = Settings()
    assert settings.data == directory_of(address) and not (settings.data / "runs").exists()
    with TestClient(create_app(settings), "http://localhost") as client:
        page = client.get(f"/ui/runs/{run}")
        assert page.status_code == 200 and run in page.text
        assert "fake" in client.get("/ui").text
        rows = list(csv.DictReader(io.StringIO(client.get(f"/studies/{study.id}/table.csv").text)))
        assert [row["status"] for row in rows] == ["ok", "ok"]
        content = client.get(f"/studies/{study.id}/dataset.nc").content
        assert loaded(content, "").sizes["friction"] == 2
        check_content(client.get(f"/runs/{run}.nc").content)
        values = client.get(f"/runs/{run}/values.csv?field=residual_stress")
        assert values.status_code == 200 and len(values.text.splitlines()) > 10
        assert client.get("/health").json()["data_writable"]
        deleted = client.delete(f"/studies/{study.id}?purge=true")
        assert deleted.is_success, deleted.text
        assert client.get(f"/studies/{study.id}").status_code == 404
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path / "third"))
    assert not Store(address).study_ids() and not Store(address).stored_runs()
