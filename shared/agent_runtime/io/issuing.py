"""The keys of a whole fleet, from its design: who gets which certificate, where, and the rules of
router and agents.

All in one folder where everybody runs as one user; `apart`, a folder for each identity, where each
process sees only its own (containers). Several systems may stand behind one router: then each
system has a folder, and the certificates in it name the system. What is there and still holds for
`keep_days` may be kept: a new authority separates agents with its keys from those with the old
ones.
"""

import datetime as dt
import ipaddress
import json
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from agent_runtime.io.run_files import write_secret
from agent_runtime.io.secured import (
    AUTHORITY,
    LINKS,
    REVOKED,
    RIGHTS,
    ROUTER,
    KeysError,
    Rights,
    certificate_file,
    key_file,
    links_file,
    revoked,
    rights_of,
)
from topdown.model.design import Design
from topdown.model.rights import access_control, common_names, links_control

# --- Certificates: an authority and one for each identity, short-lived, renewed rather than revoked
# The common name (CN) of a certificate is the identity that the router's rights name; only
# certificates of the router and of agents name hosts. The authority's private key is never written:
# who needs one more certificate makes all of them again. Elliptic keys (P-256, RFC 5480) because
# rustls, which Zenoh uses, takes them and a handshake stays short.


DAYS = 7.0
"""Lifetime of certificates (a week: as long as a stolen one is of use)."""
BACK = dt.timedelta(minutes=5)
"""They hold from a little before now, for machines whose clocks differ (estimate)."""
HOSTS = ("localhost", "127.0.0.1", "::1", "router", "wires")
"""Names under which router and agents are reached: here, as the services of these names, and by the
proxy for faults.
"""
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
    builder = _builder(name, name, key.public_key(), key.public_key(), begin, end)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    return Issuer(
        name,
        key,
        builder.add_extension(_usage(certificates=True), critical=True).sign(key, hashes.SHA256()),
    )


def certify(
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
    """Write certificate and private key of an identity; with `hosts` it may listen there, else only
    connect.

    `name`: the common name, where it is not the identity. `joins`: who listens may connect, too
    (agents).
    """
    key = ec.generate_private_key(ec.SECP256R1())
    uses = ([_SERVER, _CLIENT] if joins else [_SERVER]) if hosts else [_CLIENT]
    subject = name or identity
    builder = _builder(subject, issuer.name, key.public_key(), issuer.key.public_key(), begin, end)
    builder = builder.add_extension(
        x509.BasicConstraints(ca=False, path_length=None), critical=True
    )
    builder = builder.add_extension(_usage(certificates=False), critical=True)
    builder = builder.add_extension(x509.ExtendedKeyUsage(uses), critical=False)
    if hosts:
        builder = builder.add_extension(
            x509.SubjectAlternativeName([host(name) for name in hosts]), critical=False
        )
    signed = builder.sign(issuer.key, hashes.SHA256())
    path = certificate_file(folder, identity)
    write_secret(path, signed.public_bytes(serialization.Encoding.PEM))
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    write_secret(key_file(folder, identity), private)


def _builder(
    subject: str, issuer: str, key: Any, issuers_key: Any, begin: dt.datetime, end: dt.datetime
) -> x509.CertificateBuilder:
    named = [
        x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)]) for name in (subject, issuer)
    ]
    # wanted by RFC 5280, 4.2.1.1 and 4.2.1.2
    own, signer = x509.SubjectKeyIdentifier, x509.AuthorityKeyIdentifier
    return (
        x509.CertificateBuilder()
        .subject_name(named[0])
        .issuer_name(named[1])
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin - BACK)
        .not_valid_after(end)
        .add_extension(own.from_public_key(key), critical=False)
        .add_extension(signer.from_issuer_public_key(issuers_key), critical=False)
    )


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


OWNER_ONLY = 0o700
_IDENTIFIERS = {x509.SubjectKeyIdentifier, x509.AuthorityKeyIdentifier}


class Seat(msgspec.Struct, frozen=True):
    """Place of an identity's keys: files of `identity` in `folder`, in a certificate with the
    common name `name`.
    """

    identity: str
    name: str
    folder: Path


class Issued(msgspec.Struct, frozen=True):
    """A folder of keys. `until`: end of their validity (UTC); `made_now`: whether they were made,
    not kept.
    """

    folder: str
    systems: tuple[str, ...]
    identities: tuple[str, ...]
    until: dt.datetime
    made_now: bool


def seats(
    folder: Path,
    design: Design,
    systems: Sequence[str],
    *,
    apart: bool = False,
) -> tuple[Seat, ...]:
    """The folder of each certificate."""
    found = []
    for name, pairs in common_names(design, systems).items():
        identity, system = pairs[0]
        where = folder if name == identity else folder / system
        found.append(Seat(identity, name, where / identity if apart else where))
    return tuple(found)


def issue(
    folder: Path,
    design: Design,
    systems: Sequence[str],
    *,
    days: float = DAYS,
    hosts: Sequence[str] = HOSTS,
    apart: bool = False,
    keep_days: float | None = None,
    now: dt.datetime | None = None,
) -> Issued:
    """Make all keys of the systems, or keep what still holds for `keep_days`. Raises OSError."""
    begin = now or dt.datetime.now(dt.UTC)
    places = seats(folder, design, systems, apart=apart)
    rights = Rights(tuple(systems), access_control(design, *systems))
    links = {}  # each agent's rules for its neighbours, by its common name
    for system in systems:
        pairs = (
            (name, one) for name, ones in common_names(design, systems).items() for one in ones
        )
        names = {who: name for name, (who, of) in pairs if of == system}
        for agent in design.agents:
            links[names[agent]] = Rights((system,), links_control(design, system, agent, names))
    until = None if keep_days is None else holding(places, rights, hosts, links)
    if until is not None and keep_days is not None and until < begin + dt.timedelta(days=keep_days):
        until = None
    made_now = until is None
    if until is None:
        until = _make(folder, places, rights, begin, days, hosts, links)
    issued = tuple(seat.name for seat in places)
    return Issued(str(folder), rights.systems, issued, until, made_now)


def _make(
    folder: Path,
    places: Sequence[Seat],
    rights: Rights,
    begin: dt.datetime,
    days: float,
    hosts: Sequence[str],
    links: dict[str, Rights],
) -> dt.datetime:
    end = begin + dt.timedelta(days=days)
    issuer = authority(f"{' '.join(rights.systems)} authority"[:64], begin, end)
    routed = {seat.folder for seat in places if seat.identity == ROUTER}
    for where in (folder, *dict.fromkeys(seat.folder for seat in places)):
        where.mkdir(parents=True, exist_ok=True)
        # a mount point may be on a disk that is read only
        if stat.S_IMODE(where.stat().st_mode) != OWNER_ONLY:
            where.chmod(OWNER_ONLY)
    # the router's last: it looks for new ones
    for seat in sorted(places, key=lambda one: one.identity == ROUTER):
        routes = seat.identity == ROUTER
        if routes or (seat.name in links and seat.folder not in routed):
            # The revoked keys are of an authority that was replaced.
            (seat.folder / REVOKED).unlink(missing_ok=True)
        publish(seat.folder, issuer, rights if routes else None)
        listening = hosts if routes or seat.name in links else ()
        if seat.name in links:
            path = links_file(seat.folder, seat.identity)
            write_secret(path, msgspec.json.encode(links[seat.name]))
        identity, joins = seat.identity, seat.name in links
        certify(seat.folder, issuer, identity, begin, end, listening, name=seat.name, joins=joins)
    return end


def issue_server(
    folder: Path,
    name: str,
    at: str,
    *,
    days: float,
    keep_days: float,
    now: dt.datetime | None = None,
) -> dt.datetime:
    """Make a certificate for a server that browsers reach `at` an address or name, by an authority
    of its own; keep one that holds for `keep_days` more. Return until when it holds. Raise OSError.

    No session of the fleet takes it, and a browser that trusts it takes no key of the fleet.
    """
    begin = now or dt.datetime.now(dt.UTC)
    until = _serving(folder, name, at)
    if until is not None and until >= begin + dt.timedelta(days=keep_days):
        return until
    end = begin + dt.timedelta(days=days)
    issuer = authority(f"{name} authority", begin, end)
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(OWNER_ONLY)
    publish(folder, issuer, None)
    certify(folder, issuer, name, begin, end, (at,))
    return end


def _serving(folder: Path, name: str, at: str) -> dt.datetime | None:
    """Until when a server's certificate holds; None where it is of no use."""
    try:
        found = _certificate(certificate_file(folder, name))
        issuer = _certificate(folder / AUTHORITY)
        key = serialization.load_pem_private_key(key_file(folder, name).read_bytes(), None)
    except (OSError, ValueError, TypeError):
        return None
    whole = key.public_key() == found.public_key() and _signed(found, issuer, name)
    return found.not_valid_after_utc if whole and _listens(found, (at,)) else None


def revoke(folder: Path, name: str, *, undo: bool = False) -> tuple[str, ...]:
    """Deny the common name every right at each router and agent whose keys lie in the folder.

    Return all that are denied. Raise KeysError where no router's keys are there, or it knows no
    such name. `undo`: grant them again.
    """
    routers = sorted(file.parent for file in folder.rglob(RIGHTS))
    if not routers:
        raise KeysError(
            f"no {RIGHTS} in {folder} or below; give the folder that `roco keys make` wrote"
        )
    known = {one["id"] for where in routers for one in rights_of(where).access_control["subjects"]}
    if name not in known:
        raise KeysError(f"no certificate is named {name!r}; there are {', '.join(sorted(known))}")
    now: set[str] = set()
    for where in sorted({*routers, *(file.parent for file in folder.rglob(f"*{LINKS}"))}):
        denied = set(revoked(where)) - {name} if undo else {*revoked(where), name}
        write_secret(where / REVOKED, msgspec.json.encode(sorted(denied)))
        now |= denied
    return tuple(sorted(now))


def holding(
    places: Sequence[Seat], rights: Rights, hosts: Sequence[str], links: Mapping[str, Rights]
) -> dt.datetime | None:
    """Until when all that is there holds; None where something lacks, or is of another authority,
    system or design, or where key identifiers lack, as in certificates of older versions, which
    Python 3.13 refuses.

    `links`: the agents' rules, by common name.
    """
    try:
        authorities = {(seat.folder / AUTHORITY).read_bytes() for seat in places}
        found = [
            (seat, _certificate(certificate_file(seat.folder, seat.identity))) for seat in places
        ]
        there = all(key_file(seat.folder, seat.identity).is_file() for seat in places)
        routers = [seat.folder for seat in places if seat.identity == ROUTER]
        wanted = msgspec.json.decode(msgspec.json.encode(rights), type=Rights)
        same = all(rights_of(where, *rights.systems) == wanted for where in routers)
        for seat in (one for one in places if one.name in links):
            rules = links_file(seat.folder, seat.identity).read_bytes()
            same = same and rules == msgspec.json.encode(links[seat.name])
        (issuer,) = map(x509.load_pem_x509_certificate, authorities)
        signed = all(_signed(one, issuer, seat.name) for seat, one in found)
        every = (issuer, *(certificate for _, certificate in found))
        identified = all(
            {type(extension.value) for extension in one.extensions} >= _IDENTIFIERS for one in every
        )
        listening = (one for seat, one in found if seat.identity == ROUTER or seat.name in links)
        listens = all(_listens(one, hosts) for one in listening)
    except (OSError, ValueError, KeysError):
        return None
    if not (there and same and signed and identified and listens):
        return None
    return min(one.not_valid_after_utc for one in every)


def lifetime(file: Path) -> tuple[dt.datetime, dt.datetime]:
    """From when until when a certificate holds. Raises OSError, or ValueError where it is none."""
    found = _certificate(file)
    return found.not_valid_before_utc, found.not_valid_after_utc


def _certificate(file: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(file.read_bytes())


def _signed(certificate: x509.Certificate, issuer: x509.Certificate, name: str) -> bool:
    try:
        certificate.verify_directly_issued_by(issuer)
    # cryptography raises InvalidSignature, ValueError or TypeError: it is not of this authority
    except Exception:
        return False
    return bool(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value == name)


def _listens(certificate: x509.Certificate, hosts: Sequence[str]) -> bool:
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:  # it was made for one that only dials
        return False
    return all(host(name) in names for name in hosts)
