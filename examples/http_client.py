"""The service over HTTP: start it, submit a study, follow it, fetch its data set, stop it.

Run it with ``python examples/http_client.py``. The service uses a temporary directory and a free
port of this machine, and is stopped at the end. In daily use the service runs elsewhere, and you
need only the function `use`.
"""

import json
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx
import xarray as xr

STUDY = {
    "name": "tour",
    "scene": "punch",
    "parameters": {"smallest_element": 0.02, "growth": 2.0, "hardening": "isotropic"},
    "sweep": {"load_ratio": [0.5714, 0.8571], "friction": [0.0, 0.3]},
}


def free_port() -> int:
    """Return a free port of this machine."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_until_ready(client: httpx.Client, seconds: float = 30.0) -> None:
    """Wait until the service reports that it is ready."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            if client.get("/health").is_success:
                return
        except httpx.TransportError:  # the service does not listen yet
            pass
        time.sleep(0.2)
    raise TimeoutError("the service did not start")


def use(client: httpx.Client, target: Path) -> None:
    """Submit the study, follow it to its end, and save its data set."""
    # 201: accepted. 200: the service has this study already and does not compute it again. 4xx: a
    # problem document, whose `errors` say which field is wrong and what is allowed.
    answer = client.post("/studies", json=STUDY).raise_for_status()
    study = answer.headers["location"]  # /studies/<id>
    print(f"{answer.status_code} {study}")

    # The service sends an event after each change, and closes the stream when the study ends.
    with client.stream("GET", f"{study}/events", timeout=None) as events:
        for line in events.iter_lines():
            if line.startswith("data:"):
                now = json.loads(line.removeprefix("data:"))
                print(f"{now['status']} {now['progress']:.0f} %")
    assert now["status"] == "successful", now["message"]

    target.write_bytes(client.get(f"{study}/dataset.nc").raise_for_status().content)
    found = client.get("/runs", params={"friction": 0.3, "status": "ok"}).raise_for_status().json()
    assert found["total"] == 2, "one run for each load"


with tempfile.TemporaryDirectory() as home:
    port = free_port()
    serve = [sys.executable, "-m", "residua", "serve", "--port", str(port)]
    service = subprocess.Popen([*serve, "--data", str(Path(home, "data"))])
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=30.0) as client:
            wait_until_ready(client)
            use(client, Path(home, "tour.nc"))
    finally:
        service.terminate()  # the service shuts down cleanly, as after Ctrl-C
        service.wait(timeout=30.0)
    with xr.open_dataset(Path(home, "tour.nc")) as dataset:
        print(dataset["peak_residual_tension"].squeeze("hardening").to_pandas().to_string())
        assert (dataset["status"] == "ok").all(), "every run is ok"
