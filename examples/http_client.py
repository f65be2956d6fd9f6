"""The service over HTTP: start it, submit a study, follow it, fetch its data set, stop it.

Run it with ``python examples/http_client.py``. The service uses a temporary directory and a free
port of this machine, and is stopped at the end. In daily use the service runs elsewhere, and you
need only the function `use`.
"""

import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx

from studies import Client

STUDY = {
    "name": "tour",
    "scene": "punch",
    "parameters": {"accuracy": "draft", "smallest_element": 0.05, "hardening": "isotropic"},
    "sweep": {"load_ratio": [0.5714, 0.8571], "friction": [0.0, 0.3]},
}


def free_port() -> int:
    """Return a free port of this machine."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_until_ready(url: str, seconds: float = 120.0) -> None:
    """Wait until the service reports that it is ready."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            if httpx.get(f"{url}/health").is_success:
                return
        except httpx.TransportError:  # the service does not listen yet
            pass
        time.sleep(0.2)
    raise TimeoutError("the service did not start")


def use(service: Client, target: Path) -> None:
    """Submit the study, follow it to its end, read numbers and the data set, and save it."""
    # A study that the service has already is not computed again. A wrong one raises `Refused`,
    # whose text says which field is wrong and what is allowed.
    study = service.submit(STUDY)
    study.wait()  # a bar on a terminal, the study itself in a notebook
    print(study)
    assert study.detail()["status"] == "successful"

    rows = study.table(
        friction="0.3", sort="load_ratio", columns="load_ratio,peak_residual_tension"
    )
    assert [row["load_ratio"] for row in rows] == [0.5714, 0.8571], "one run for each load"

    dataset = study.open()  # also while the study runs; values are read when they are used
    print(dataset["peak_residual_tension"].squeeze("hardening").to_pandas().to_string())
    assert (dataset["status"] == "ok").all(), "every run is ok"
    study.fetch(target)


with tempfile.TemporaryDirectory() as home:
    port = free_port()
    serve = [sys.executable, "-m", "residua", "serve", "--port", str(port)]
    service = subprocess.Popen([*serve, "--data", str(Path(home, "data"))])
    try:
        url = f"http://127.0.0.1:{port}"
        wait_until_ready(url)
        with Client(url) as client:
            use(client, Path(home, "tour.nc"))
    finally:
        service.terminate()  # the service shuts down cleanly, as after Ctrl-C
        service.wait(timeout=30.0)
