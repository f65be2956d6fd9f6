"""Certificates of a scheduler, its workers and the service: one each, of one authority.

Anybody who has a key may run code on the workers, so each process sees only its own. The key of the
authority is not stored: nobody can add a certificate later, and all are made again together.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID

from solver.files import appearing

_LIFE = timedelta(days=3650)

_ENDS = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH])
"""Each end accepts and begins connections: workers talk to each other."""

_Key = ec.EllipticCurvePrivateKey


OWNERS = ("scheduler", "worker", "service")
"""Who has a certificate; all workers share one."""


def write_certificates(directory: Path) -> Sequence[Path]:
    """Write ``ca.pem``, ``cert.pem`` and ``key.pem`` in a folder for each of `OWNERS`.

    If all exist, none is written. Only the owner of a file may read it.

    Returns
    -------
    Sequence[Path]
        the new files
    """
    names = ("ca.pem", "cert.pem", "key.pem")
    paths = [directory / owner / name for owner in OWNERS for name in names]
    if all(path.is_file() for path in paths):  # those who run already hold them
        return []
    key = ec.generate_private_key(ec.SECP256R1())
    authority = _certificate("residua", key, "residua", key)
    contents = []
    for owner in OWNERS:
        own = ec.generate_private_key(ec.SECP256R1())
        private = own.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
        contents += [authority, _certificate(f"residua {owner}", own, "residua", key), private]
    for path, content in zip(paths, contents, strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        with appearing(path) as part:
            part.touch(mode=0o600)
            part.write_bytes(content)
    return paths


def _certificate(name: str, own: _Key, issuer: str, key: _Key) -> bytes:
    """Return the certificate of a key that another key signs; one signed by itself may sign."""
    now, signs = datetime.now(UTC), own is key
    usages = [not signs, False, False, False, False, signs, signs, False, False]
    begun = (
        x509.CertificateBuilder()
        .subject_name(_name(name))
        .issuer_name(_name(issuer))
        .public_key(own.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))  # clocks of other machines
        .not_valid_after(now + _LIFE)
        .add_extension(x509.BasicConstraints(ca=signs, path_length=None), critical=True)
        .add_extension(x509.KeyUsage(*usages), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(own.public_key()), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()), critical=False
        )
    )
    whole = begun if signs else begun.add_extension(_ENDS, critical=False)
    return whole.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)])
