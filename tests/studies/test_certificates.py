"""Certificates of scheduler, workers and clients: who holds them gets in, nobody else."""

from __future__ import annotations

import contextlib
import ssl
from pathlib import Path

import pytest
from cryptography import x509

from residua.cli import main


def context(side: int, certificates: Path) -> ssl.SSLContext:
    """Return how dask sets up one end: it shows its certificate and asks for the other's."""
    found = ssl.SSLContext(side)
    found.check_hostname = False
    found.verify_mode = ssl.CERT_REQUIRED
    found.verify_flags |= ssl.VERIFY_X509_STRICT  # by default from Python 3.13 on
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
    assert capsys.readouterr().out.count("wrote ") == 18
    for client in ("worker", "service"):
        shake_hands(ours / "scheduler", ours / client)
        with pytest.raises(ssl.SSLError):
            shake_hands(ours / "scheduler", theirs / client)
    for key in ours.glob("*/key.pem"):
        assert key.stat().st_mode & 0o777 == 0o600


def test_each_has_a_certificate_of_its_own_and_none_may_make_another(tmp_path: Path) -> None:
    assert main(["certificates", "--out", str(tmp_path)]) == 0
    found = {
        path.parent.name: x509.load_pem_x509_certificate(path.read_bytes())
        for path in tmp_path.glob("*/cert.pem")
    }
    assert set(found) == {"scheduler", "worker", "service"}
    assert len({path.read_bytes() for path in tmp_path.glob("*/key.pem")}) == 3
    (authority,) = {path.read_bytes() for path in tmp_path.glob("*/ca.pem")}
    signer = x509.load_pem_x509_certificate(authority)
    for each in found.values():
        each.verify_directly_issued_by(signer)
        assert not each.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        assert each.public_key() != signer.public_key(), "the key of the authority is not stored"


def test_certificates_that_are_in_use_stay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certificates", "--out", str(tmp_path)]) == 0
    before = {path: path.read_bytes() for path in tmp_path.glob("*/*")}
    assert len(before) == 9
    assert main(["certificates", "--out", str(tmp_path)]) == 0
    assert {path: path.read_bytes() for path in tmp_path.glob("*/*")} == before
