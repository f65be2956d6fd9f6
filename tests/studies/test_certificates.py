"""Certificates of scheduler, workers and clients: who holds them gets in, nobody else."""

from __future__ import annotations

import contextlib
import ssl
from pathlib import Path

import pytest

from residua.cli import main


def context(side: int, certificates: Path) -> ssl.SSLContext:
    """Return how dask sets up one end: it shows its certificate and asks for the other's."""
    found = ssl.SSLContext(side)
    found.check_hostname = False
    found.verify_mode = ssl.CERT_REQUIRED
    found.load_verify_locations(certificates / "ca.pem")
    found.load_cert_chain(certificates / "cert.pem", certificates / "key.pem")
    return found


def shake_hands(server: Path, client: Path) -> None:
    """Connect two ends in memory; raise what keeps them apart."""
    ends = [
        (ssl.PROTOCOL_TLS_SERVER, server, ssl.MemoryBIO(), ssl.MemoryBIO()),
        (ssl.PROTOCOL_TLS_CLIENT, client, ssl.MemoryBIO(), ssl.MemoryBIO()),
    ]
    objects = [
        context(side, home).wrap_bio(inner, outer, server_side=side == ssl.PROTOCOL_TLS_SERVER)
        for side, home, inner, outer in ends
    ]
    for _ in range(4):
        for number, each in enumerate(objects):
            with contextlib.suppress(ssl.SSLWantReadError):
                each.do_handshake()
            ends[1 - number][2].write(ends[number][3].read())
    assert all(each.cipher() for each in objects)


def test_who_holds_the_certificate_gets_in_and_nobody_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    for home in (ours, theirs):
        assert main(["certificates", "--out", str(home)]) == 0
    assert capsys.readouterr().out.count("wrote ") == 6
    shake_hands(ours, ours)
    with pytest.raises(ssl.SSLError):
        shake_hands(ours, theirs)
    assert (ours / "key.pem").stat().st_mode & 0o777 == 0o600


def test_certificates_that_are_in_use_stay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certificates", "--out", str(tmp_path)]) == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"ca.pem", "cert.pem", "key.pem"}
    assert main(["certificates", "--out", str(tmp_path)]) == 0
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
