"""Certificates of a fleet: an authority and one certificate per identity, short-lived, renewed rather than revoked.

The common name (CN) of a certificate is the identity that the router's rights name; only certificates of the
router and of agents name hosts. The authority's private key is never written: who needs one more certificate
makes all of them again. Elliptic keys (P-256, RFC 5480) because rustls, which Zenoh uses, takes them and a handshake
stays short.
"""

import datetime as dt
import ipaddress
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from agent_runtime.io.run_files import write_secret
from agent_runtime.io.secured import AUTHORITY, RIGHTS, Rights, certificate_file, key_file

DAYS = 7.0
"""Lifetime of certificates (a week: as long as a stolen one is of use)."""
BACK = dt.timedelta(minutes=5)
"""They hold from a little before now, for machines whose clocks differ (estimate)."""
HOSTS = ("localhost", "127.0.0.1", "::1", "router", "wires")
"""Names under which router and agents are reached: here, as the services of these names, and by the proxy for
faults."""
_SERVER, _CLIENT = ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH


class Issuer(msgspec.Struct, frozen=True):
    """An authority that signs until it is forgotten."""

    name: str
    key: ec.EllipticCurvePrivateKey
    certificate: x509.Certificate


def publish(folder: Path, issuer: Issuer, rights: Rights | None) -> None:
    """Write the public parts: the authority's certificate and, where the router is, its rights."""
    write_secret(folder / AUTHORITY, issuer.certificate.public_bytes(serialization.Encoding.PEM))
    if rights is not None:
        write_secret(folder / RIGHTS, json.dumps(msgspec.to_builtins(rights), indent=1).encode())


def authority(name: str, begin: dt.datetime, end: dt.datetime) -> Issuer:
    """A new authority that may sign certificates of identities, and no other authority."""
    key = ec.generate_private_key(ec.SECP256R1())
    usage = _usage(certificates=True)
    builder = _builder(name, name, key.public_key(), key.public_key(), begin, end)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    return Issuer(name, key, builder.add_extension(usage, critical=True).sign(key, hashes.SHA256()))


def issue(
    folder: Path,
    issuer: Issuer,
    identity: str,
    begin: dt.datetime,
    end: dt.datetime,
    hosts: Sequence[str] = (),
    *,
    name: str = "",
    joins: bool = False,
) -> None:
    """Write certificate and private key of an identity; with `hosts` it may listen there, else only connect.

    `name`: the common name, where it is not the identity. `joins`: who listens may connect, too (agents).
    """
    key = ec.generate_private_key(ec.SECP256R1())
    uses = ([_SERVER, _CLIENT] if joins else [_SERVER]) if hosts else [_CLIENT]
    builder = _builder(name or identity, issuer.name, key.public_key(), issuer.key.public_key(), begin, end)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    builder = builder.add_extension(_usage(certificates=False), critical=True)
    builder = builder.add_extension(x509.ExtendedKeyUsage(uses), critical=False)
    if hosts:
        builder = builder.add_extension(x509.SubjectAlternativeName([host(name) for name in hosts]), critical=False)
    signed = builder.sign(issuer.key, hashes.SHA256())
    write_secret(certificate_file(folder, identity), signed.public_bytes(serialization.Encoding.PEM))
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    write_secret(key_file(folder, identity), private)


def _builder(
    subject: str, issuer: str, key: Any, issuers_key: Any, begin: dt.datetime, end: dt.datetime
) -> x509.CertificateBuilder:
    own, signer = x509.SubjectKeyIdentifier, x509.AuthorityKeyIdentifier  # wanted by RFC 5280, 4.2.1.1 and 4.2.1.2
    return (
        x509.CertificateBuilder()
        .subject_name(_named(subject))
        .issuer_name(_named(issuer))
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin - BACK)
        .not_valid_after(end)
        .add_extension(own.from_public_key(key), critical=False)
        .add_extension(signer.from_issuer_public_key(issuers_key), critical=False)
    )


def _named(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def host(name: str) -> x509.GeneralName:
    """A host as certificates name it: an address or a name."""
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _usage(*, certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=certificates,
        crl_sign=certificates,
        encipher_only=False,
        decipher_only=False,
    )
