"""The certificate that a scheduler, its workers and its clients share.

Anybody who has the key may run code on the workers. Scheduler, workers and clients share one
certificate, because separate ones would not increase security. dask does the same for the clusters
it starts (`distributed.security.Security.temporary`), for one year; these are valid for ten.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from studies.storage.appearing import appearing

_LIFE = timedelta(days=3650)


def write_certificates(directory: Path) -> Sequence[Path]:
    """Write ``ca.pem``, ``cert.pem`` and ``key.pem``, unless all exist; return the new files.

    The certificate is self-signed, so ``ca.pem`` is a copy of ``cert.pem``. Only the owner may read
    the key.
    """
    directory.mkdir(parents=True, exist_ok=True)
    paths = [directory / name for name in ("ca.pem", "cert.pem", "key.pem")]
    if all(path.is_file() for path in paths):  # those who run already hold them
        return []
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "residua")])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))  # clocks of other machines
        .not_valid_after(now + _LIFE)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    public = certificate.public_bytes(serialization.Encoding.PEM)
    private = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    for path, content in zip(paths, (public, public, private), strict=True):
        with appearing(path) as part:
            part.touch(mode=0o600)
            part.write_bytes(content)
    return paths
