"""The page on a tablet in the same network: over TLS, only where it was asked for, and for nobody
whom the terminal did not let in.
"""

import base64
import contextlib
import hashlib
import http.client
import os
import pty
import re
import shutil
import socket
import ssl
import subprocess
import sys
import threading
import time
from urllib.parse import urlencode

import cv2
import numpy as np
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from page_house import WITHIN_S, PageProcess, wait_for
from playwright.sync_api import Error, expect

from agent_runtime.io.options import USAGE_ERROR
from companion.loopback_server import HANDSHAKE_S, HANDSHAKES, TAKEN_EACH_S
from companion.run_files import PAGE_KEYS
from services.page.__main__ import for_tablets
from services.page.certificate import DAY_S, DAYS, Certificate

pytestmark = pytest.mark.process
LAN = "192.0.2.1"
"""An address of documentation (RFC 5737): nothing is sent there, the way there is looked up."""


@pytest.fixture(scope="module")
def here():
    """This machine's address in a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        with contextlib.suppress(OSError):
            probe.connect((LAN, 9))
        found = probe.getsockname()[0]
    if found == "0.0.0.0":
        pytest.skip("needs an address in a network (as root: ip addr add 192.0.2.2/24 dev lo)")
    return found


def free_port(host):
    """A port that nobody has now."""
    with socket.create_server((host, 0)) as one:
        return one.getsockname()[1]


@pytest.fixture
def page(house, here):
    """A page for this machine and for the network."""
    made = PageProcess(house.run, ROCO_PAGE=f"{here}:{free_port(here)}")
    yield made
    made.kill()


def reached(page):
    """Host and port for tablets."""
    host, _, port = page.address.tablet.rpartition(":")
    return host, int(port)


def trusting(page):
    """What knows the page by the authority of its certificate."""
    return ssl.create_default_context(cafile=page.run / PAGE_KEYS / "authority.pem")


def asked(page, verb, path, body=None, **headers):
    """Status, body and headers of an answer to a tablet that knows the certificate."""
    host, port = reached(page)
    with contextlib.closing(
        http.client.HTTPSConnection(host, port, timeout=WITHIN_S, context=trusting(page))
    ) as connection:
        told = {name.replace("_", "-"): text for name, text in headers.items() if text is not None}
        connection.request(verb, path, body, told)
        answer = connection.getresponse()
        return answer.status, answer.read(), dict(answer.getheaders())


def form(page, path, fields, cookie="", **headers):
    """A form as the tablet's page sends it; other headers replace its own, None leaves one out."""
    told = {"Origin": f"https://{page.address.tablet}", "Accept": "application/json"}
    told |= {"Cookie": cookie, "Content-Type": "application/x-www-form-urlencoded"}
    return asked(page, "POST", path, urlencode(fields), **(told | headers))


def paired(page):
    """The Cookie header of a newly paired tablet."""
    status, _, headers = form(page, "/pair", {"code": page.code()})
    assert status == 200
    return headers["set-cookie"].partition(";")[0]


def fingerprint(data):
    """SHA-256, as openssl prints it."""
    return hashlib.sha256(data).digest().hex(":").upper()


# --- The terminal: what `roco page` prints, as a camera sees it -----------------------------------

THEMES = {"dark": (220, 20), "light": (30, 250)}
"""Greys of a terminal: of text, of what is behind it."""
BASIC = (0, 110, 110, 110, 110, 110, 110, 190, 90, 150, 150, 150, 150, 150, 150, 255)
"""Greys of the sixteen colours (about xterm's)."""
HALF = 10
"""Side of half a character [pixels]."""


def printed(page, **settings):
    """What `roco page` prints to a terminal."""
    above, below = pty.openpty()
    words = [sys.executable, "-P", "-m", "console", "page", "--run-dir", str(page.run)]
    settings = {"PATH": os.environ["PATH"], "TERM": "xterm-256color"} | settings
    process = subprocess.Popen(words, env=settings, stdin=below, stdout=below, stderr=below)
    os.close(below)
    said = b""
    with os.fdopen(above, "rb", buffering=0) as terminal:
        with contextlib.suppress(OSError):  # the other side has closed it
            while data := terminal.read(65536):
                said += data
        assert process.wait(WITHIN_S) == 0, said
    return said.decode()


def grey(numbers, usual):
    """The grey of a colour of an SGR sequence, without its first number."""
    if numbers[:1] == [2]:
        return sum(numbers[1:4]) // 3
    if numbers[:1] == [5]:
        return {16: 0, 231: 255}.get(numbers[1]) if numbers[1] > 15 else BASIC[numbers[1]]
    return usual


def picture(text, theme):
    """The half blocks of a terminal as pixels."""
    usual = THEMES[theme]
    ink, paper = usual
    rows = []
    for line in text.splitlines():
        above, below = [], []
        for part in re.split(r"(\x1b\[[\d;]*m)", line):
            if found := re.fullmatch(r"\x1b\[([\d;]*)m", part):
                numbers = [int(one or 0) for one in found[1].split(";")]
                while numbers:
                    one, *rest = numbers
                    numbers = rest
                    if one == 0:
                        ink, paper = usual
                    elif one in (38, 48):
                        taken = grey(rest, None)
                        ink, paper = (taken, paper) if one == 38 else (ink, taken)
                        numbers = rest[2 if rest[0] == 5 else 4 :]
                    elif one % 60 in range(30, 38):
                        ink = BASIC[one % 60 - 30 + 8 * (one > 60)]
                    elif one % 60 in range(40, 48):
                        paper = BASIC[one % 60 - 40 + 8 * (one > 60)]
            else:
                above += [ink if one in "▀█" else paper for one in part]
                below += [ink if one in "▄█" else paper for one in part]
        if any(one in line for one in "▀▄█"):
            rows += [above, below]
    width = max(map(len, rows))
    beside = usual[1]
    whole = [row + [beside] * (width - len(row)) for row in rows]
    pixels = np.kron(np.array(whole, np.uint8), np.ones((HALF, HALF), np.uint8))
    return cv2.copyMakeBorder(pixels, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=beside)


def scanned(text, theme):
    """What a camera reads in it."""
    return cv2.QRCodeDetector().detectAndDecode(picture(text, theme))[0]


@pytest.mark.parametrize("settings", [{}, {"TERM": "xterm", "NO_COLOR": "1", "COLUMNS": "20"}])
def test_the_terminal_prints_what_a_tablet_needs(page, settings):
    """The address, once in letters and once as a QR code that can be read in a light and in a dark
    terminal, and the fingerprint of the certificate that the tablet gets.
    """
    said = printed(page, **settings)
    at = re.search(rf"https://{re.escape(page.address.tablet)}/pair#\d{{6}}", said)[0]
    assert f"http://127.0.0.1:{page.address.port}/pair#{at[-6:]}" in said
    assert {theme: scanned(said, theme) for theme in THEMES} == dict.fromkeys(THEMES, at)
    host, port = reached(page)
    shown = ssl.get_server_certificate((host, port), timeout=WITHIN_S)
    assert fingerprint(ssl.PEM_cert_to_DER_cert(shown)) in said
    assert form(page, "/pair", {"code": at[-6:]})[0] == 200


def test_a_tablet_pairs_by_the_code_and_a_sentence_moves_the_robot(page, house, browser):
    """A real browser that knows the certificate; one that does not is warned and shows nothing.

    Its cookie goes over TLS alone.
    """
    at = scanned(printed(page), "dark")
    pem = (page.run / PAGE_KEYS / "page.pem").read_bytes()
    public = x509.load_pem_x509_certificate(pem).public_key()
    info = serialization.PublicFormat.SubjectPublicKeyInfo
    key = hashlib.sha256(public.public_bytes(serialization.Encoding.DER, info)).digest()
    known = f"--ignore-certificate-errors-spki-list={base64.b64encode(key).decode()}"
    stranger = browser.new_page()
    with pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
        stranger.goto(at)
    stranger.close()
    launched = browser.browser_type.launch(
        executable_path=shutil.which("chromium"), chromium_sandbox=os.geteuid() != 0, args=[known]
    )
    with contextlib.closing(launched):
        one = launched.new_page(viewport={"width": 800, "height": 1200}, has_touch=True)
        one.set_default_timeout(WITHIN_S * 1000)
        wrong = []
        one.on("pageerror", lambda error: wrong.append(str(error)))
        one.goto(at)
        expect(one.locator("#now")).to_contain_text("Velma")
        assert one.url == f"https://{page.address.tablet}/"
        one.locator("#text").fill("take the jar")
        one.locator("#send").tap()
        wait_for(lambda: len(house.asked) == 1, "it is asked for")
        one.locator("#stop").tap()
        wait_for(lambda: house.held, "the robot is stopped")
        (cookie,) = one.context.cookies()
        assert (cookie["secure"], cookie["httpOnly"], cookie["sameSite"]) == (True, True, "Strict")
        assert not wrong


# --- Who is refused -------------------------------------------------------------------------------

POSTS = ("/say", "/first", "/cancel", "/stop", "/release")
GETS = ("/events", "/speech?text=hello", "/static/page.js")


def foreign(page):
    """Headers that no page of this tablet sends."""
    host, port = reached(page)
    loopback = f"127.0.0.1:{page.address.port}"
    return (
        {"Origin": f"http://{page.address.tablet}"},
        {"Origin": f"https://{host}"},
        {"Origin": f"http://{loopback}"},
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": None},
        {"Sec_Fetch_Site": "cross-site"},
        *(
            {"Host": one, "Origin": f"https://{one}"}
            for one in (f"evil.example:{port}", host, loopback, f"localhost:{port}")
        ),
    )


def test_only_the_page_of_the_tablet_is_served(page, house):
    """Another Host or Origin is refused with a valid cookie; without one, all is; a code is made on
    the robot's machine alone.
    """
    cookie, code = paired(page), page.code()
    fields = {"text": "take the jar", "code": code}
    for headers in foreign(page):
        for path in (*POSTS, "/pair"):
            status, said, _ = form(page, path, fields, cookie, **headers)
            assert status == 403, (headers, path, said)
    for other in ("", f"velma-{page.address.port}=made-up"):
        assert {form(page, path, fields, other)[0] for path in POSTS} == {401}
        assert {asked(page, "GET", path, Cookie=other)[0] for path in GETS} == {401}
    token = {"Authorization": f"Bearer {page.address.token}"}
    assert asked(page, "POST", "/code", **token)[0] == 403
    assert not house.asked
    assert not house.held
    assert form(page, "/say", fields, cookie)[0] == 200
    assert form(page, "/stop", {}, cookie)[0] == 200
    assert house.held


def test_on_loopback_it_is_as_without_a_tablet(page, house):
    """Its own Host and Origin, its codes; no word for the network is taken there."""
    cookie = page.paired()
    at = page.address.tablet
    assert page.form("/stop", {}, cookie, Host=at, Origin=f"https://{at}")[0] == 403
    assert page.form("/stop", {}, cookie, Origin=f"https://{at}")[0] == 403
    assert not house.held
    assert page.form("/stop", {}, cookie)[0] == 200
    assert house.held


def test_without_tls_nothing_is_answered(page):
    """Neither HTTP, nor an older TLS."""
    host, port = reached(page)
    with socket.create_connection((host, port), timeout=WITHIN_S) as one:
        one.sendall(b"GET / HTTP/1.1\r\nHost: " + page.address.tablet.encode() + b"\r\n\r\n")
        said = b""
        with contextlib.suppress(ConnectionError):
            while data := one.recv(4096):
                said += data
        assert b"HTTP" not in said
    old = trusting(page)
    old.maximum_version = ssl.TLSVersion.TLSv1_2
    with (
        socket.create_connection((host, port), timeout=WITHIN_S) as one,
        pytest.raises((ssl.SSLError, ConnectionError)),
    ):
        old.wrap_socket(one, server_hostname=host)


# --- Off, unless somebody asks for it -------------------------------------------------------------


def listening(pid):
    """The addresses at which a process listens."""
    mine = set()
    for name in os.listdir(f"/proc/{pid}/fd"):
        with contextlib.suppress(OSError):
            mine.add(os.readlink(f"/proc/{pid}/fd/{name}"))
    found = set()
    for kind in ("tcp", "tcp6"):
        with contextlib.suppress(OSError), open(f"/proc/{pid}/net/{kind}") as table:
            for row in list(table)[1:]:
                words = row.split()
                if words[3] == "0A" and f"socket:[{words[9]}]" in mine:
                    data = bytes.fromhex(words[1].partition(":")[0])[::-1]
                    found.add(socket.inet_ntoa(data) if kind == "tcp" else data.hex())
    return found


def test_the_network_reaches_it_only_if_asked_for(house, page, here, tmp_path):
    """Without ROCO_PAGE it listens on loopback alone; with it, there and at that address."""
    assert listening(page.process.pid) == {"127.0.0.1", here}
    page.kill()
    (tmp_path / "other").mkdir()
    other = PageProcess(tmp_path / "other")
    try:
        assert listening(other.process.pid) == {"127.0.0.1"}
        assert other.address.tablet == ""
        assert not (other.run / PAGE_KEYS).exists()
    finally:
        other.kill()


@pytest.mark.parametrize(
    ("host", "why"),
    [
        ("0.0.0.0", "name the one that the tablet reaches"),
        ("::1", "has no IPv4 address"),
    ],
)
def test_an_address_that_no_tablet_can_use_is_refused(host, why, tmp_path):
    """With what to do instead, before anything listens."""
    settings = {"PATH": os.environ["PATH"], "ROCO_RUN_DIR": str(tmp_path / "run")}
    done = subprocess.run(
        [sys.executable, "-m", "services.page"],
        env=settings | {"ROCO_PAGE": f"{host}:8351", "ROCO_CONNECT": "tcp/127.0.0.1:1"},
        capture_output=True, text=True, timeout=WITHIN_S,
    )  # fmt: skip
    assert done.returncode == USAGE_ERROR
    assert done.stderr.startswith("ROCO_PAGE: ")
    assert why in done.stderr
    assert not (tmp_path / "run").exists()


def test_which_addresses_are_of_the_network():
    """In a container of its own 0.0.0.0 is published on loopback."""
    assert not for_tablets("127.0.0.1", published=False)
    assert not for_tablets("localhost", published=False)
    assert not for_tablets("0.0.0.0", published=True)
    assert for_tablets(LAN, published=False)
    assert for_tablets(LAN, published=True)


def test_in_a_container_it_is_served_without_tls(house, tmp_path):
    """As deploy/compose.yaml has it: at all addresses of the container, for Host on loopback."""
    made = PageProcess(house.run, ROCO_PAGE="0.0.0.0:0", ROCO_HI="127.0.0.1")
    try:
        assert listening(made.process.pid) == {"0.0.0.0"}
        assert made.form("/stop", {}, made.paired())[0] == 200
        assert house.held
    finally:
        made.kill()


# --- The certificate ------------------------------------------------------------------------------


def test_a_paired_tablet_meets_the_same_page_after_a_restart(page):
    """The same certificate, port and cookie."""
    cookie = paired(page)
    before = (page.run / PAGE_KEYS / "page.pem").read_bytes()
    page.kill()
    page.start()
    assert (page.run / PAGE_KEYS / "page.pem").read_bytes() == before
    assert form(page, "/stop", {}, cookie)[0] == 200
    for file in (page.run / PAGE_KEYS).iterdir():
        assert file.stat().st_mode & 0o077 == 0


def hands_shaken(context, authority, at="192.0.2.7"):
    """The certificate that a client gets which trusts this authority, in memory."""
    to, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    trusts = ssl.create_default_context(cafile=authority)
    client = trusts.wrap_bio(back, to, server_hostname=at)
    server = context.wrap_bio(to, back, server_side=True)
    for one in (client, server, client):
        with contextlib.suppress(ssl.SSLWantReadError):
            one.do_handshake()
    return client.getpeercert(binary_form=True)


def test_a_certificate_is_made_again_on_its_last_day(tmp_path):
    """While the page runs; connections after that get the new one."""
    authority = tmp_path / "authority.pem"
    made = Certificate(tmp_path, "192.0.2.7")
    first, now = hands_shaken(made.context, authority), time.time()
    made.renew(now + (DAYS - 2) * DAY_S)
    assert hands_shaken(made.context, authority) == first
    made.renew(now + (DAYS - 0.5) * DAY_S)
    assert fingerprint(stored(tmp_path)) != fingerprint(first)
    assert (tmp_path / "page.key").stat().st_mode & 0o077 == 0


def stored(folder):
    """The certificate in a folder, DER."""
    return ssl.PEM_cert_to_DER_cert((folder / "page.pem").read_text())


def another(folder, name):
    """Put a file of another page's keys there."""
    Certificate(folder / "other", "192.0.2.7")
    (folder / "other" / name).replace(folder / name)


@pytest.mark.parametrize(
    ("damage", "at"),
    [
        (lambda folder: another(folder, "page.key"), "192.0.2.7"),
        (lambda folder: another(folder, "authority.pem"), "192.0.2.7"),
        (lambda folder: (folder / "page.key").write_bytes(b"nonsense"), "192.0.2.7"),
        (lambda folder: (folder / "page.pem").unlink(), "192.0.2.7"),
        (lambda folder: None, "192.0.2.8"),
        (lambda folder: None, "robot.lan"),
    ],
)
def test_a_certificate_of_no_use_is_made_again(damage, at, tmp_path):
    """As a page that was killed while it made its keys left them, or one at another address."""
    Certificate(tmp_path, "192.0.2.7")
    kept = stored(tmp_path)
    Certificate(tmp_path, "192.0.2.7")
    assert stored(tmp_path) == kept
    damage(tmp_path)
    made = Certificate(tmp_path, at)
    got = hands_shaken(made.context, tmp_path / "authority.pem", at)
    assert got == stored(tmp_path) != kept


# --- Crowds ---------------------------------------------------------------------------------------


def test_a_handshake_without_an_end_keeps_no_place(page, house):
    """Of more than may be under way at once the oldest goes; all go in time. A tablet and this
    machine are served meanwhile.
    """
    cookie, mine = paired(page), page.paired()
    host, port = reached(page)
    came = time.monotonic()
    crowd = [
        socket.create_connection((host, port), timeout=WITHIN_S) for _ in range(HANDSHAKES + 30)
    ]
    for one in crowd[::2]:
        one.sendall(b"\x16\x03\x01\x02\x00\x01")  # the begin of a ClientHello
    assert page.form("/stop", {}, mine)[0] == 200
    assert house.held
    assert form(page, "/release", {}, cookie)[0] == 200
    assert not house.held
    wait_for(lambda: sum(map(over, crowd)) >= 30, "the oldest are ended at once")
    assert time.monotonic() - came < HANDSHAKE_S, "they ended by their time, not by their number"
    wait_for(lambda: all(map(over, crowd)), "all of them are ended", HANDSHAKE_S + WITHIN_S)
    for one in crowd:
        one.close()


def over(one):
    """Whether the other side has ended the connection."""
    one.setblocking(False)
    try:
        return not one.recv(4096)
    except BlockingIOError:
        return False
    except ConnectionError:
        return True


def test_a_flood_of_handshakes_is_taken_bit_by_bit(page):
    """So that it takes little of a processor which the robot's loop needs."""
    context, (host, port) = trusting(page), reached(page)
    begun = time.monotonic()
    done = []

    def shake():
        while time.monotonic() < begun + 2.0:
            with (
                contextlib.suppress(OSError),
                socket.create_connection((host, port), timeout=WITHIN_S) as one,
                context.wrap_socket(one, server_hostname=host),
            ):
                done.append(time.monotonic())

    threads = [threading.Thread(target=shake) for _ in range(8)]
    for one in threads:
        one.start()
    for one in threads:
        one.join(WITHIN_S)
    assert 10 < len(done) <= (max(done) - begun) / TAKEN_EACH_S + 1
