"""Access to the page: for a paired browser, from the page itself, at this machine's loopback; and
rate limits.
"""

import itertools
import re

import msgspec
import pytest
from page_house import wait_for
from playwright.sync_api import expect

from companion.run_files import SLOTS_FILE
from services.page.guard import CODE_S, TRIES, Bucket, Pairs

POSTS = ("/say", "/first", "/cancel", "/stop", "/release")
GETS = ("/events", "/speech?text=hello", "/static/page.js")


@pytest.mark.process
def test_a_code_pairs_one_browser_once(page, opened):
    """The second browser with the same address stays outside; the code leaves the address; nothing
    is shown before.
    """
    one = opened(paired=False, at="/")
    expect(one.get_by_role("heading", name="Connect this browser")).to_be_visible()
    expect(one.locator("#stop")).to_have_count(0)
    code = page.code()
    one.goto(f"{page.url}/pair#{code}")
    expect(one.locator("#stop")).to_be_visible()
    assert one.url == f"{page.url}/"
    other = opened(paired=False, at=f"/pair#{code}")
    expect(other.locator("#answer")).to_contain_text(
        "That code is wrong, was used already, or is too old"
    )
    assert code not in other.url
    assert code not in (page.run / "page.log").read_text()
    other.get_by_label("Code").fill(page.code())
    other.keyboard.press("Enter")
    expect(other.locator("#stop")).to_be_visible()


@pytest.mark.process
def test_the_cookie_is_the_pages_alone(page):
    """Scripts do not see it, other sites do not send it; it is not in the run folder."""
    _, _, headers = page.form("/pair", {"code": page.code()})
    told = headers["set-cookie"].lower()
    assert "httponly" in told
    assert "samesite=strict" in told
    value = re.search(r"=([^;]+);", headers["set-cookie"])[1]
    assert all(
        value.encode() not in file.read_bytes() for file in page.run.rglob("*") if file.is_file()
    )


@pytest.mark.process
def test_without_a_cookie_nothing_is_shown_or_done(page, house):
    """No state, no picture, no voice, no action; a made-up cookie is none."""
    for cookie in ("", f"velma-{page.address.port}=made-up"):
        assert {page.ask("GET", path, Cookie=cookie)[0] for path in GETS} == {401}
        assert {page.form(path, {"text": "stop"}, cookie)[0] for path in POSTS} == {401}
    assert not house.held
    assert not house.asked


FOREIGN = (
    {"Origin": "http://evil.example"},
    {"Origin": "null"},
    {"Origin": None},
    {"Origin": "http://127.0.0.1:9"},
    {"Sec_Fetch_Site": "same-site"},
    {"Sec_Fetch_Site": "cross-site"},
    {"Host": "evil.example"},
    {"Host": "127.0.0.1"},
)


@pytest.mark.process
def test_a_foreign_page_does_nothing_with_the_cookie(page, house):
    """Cookies ignore ports, and a rebound name comes with the right address: Origin and Host are
    what counts.

    The same requests are served otherwise; also where the browser calls this machine localhost.
    """
    cookie = page.paired()
    code = page.code()
    for headers, path in itertools.product(FOREIGN, (*POSTS, "/pair")):
        status, said, _ = page.form(path, {"text": "take the jar", "code": code}, cookie, **headers)
        assert status == 403, (headers, path, said)
    assert not house.held
    assert not house.asked
    assert page.form("/say", {"text": "take the jar"}, cookie)[0] == 200
    there = f"localhost:{page.address.port}"
    assert page.form("/stop", {}, cookie, Host=there, Origin=f"http://{there}")[0] == 200
    assert house.held


@pytest.mark.process
def test_other_pages_may_not_show_or_read_it(page):
    """No frame, no script of elsewhere, no reading across origins, even for a page at another port
    of this machine, or one whose name is made to point here.
    """
    cookie = page.paired()
    for path in ("/", "/pair", *GETS):
        host = f"evil.example:{page.address.port}"
        status, _, _ = page.ask("GET", path, Cookie=cookie, Host=host)
        assert status == 403, path
    for path in GETS:
        assert page.ask("GET", path, Cookie=cookie, Sec_Fetch_Site="same-site")[0] == 403
    _, _, headers = page.ask("GET", "/", Cookie=cookie)
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["referrer-policy"] == "same-origin"


@pytest.mark.process
def test_a_form_of_another_port_is_refused_in_a_browser(page, house, opened):
    """The cookie goes along to every port of this machine: a real browser, a form, a foreign
    Origin.
    """
    one = opened()
    foreign = f"http://localhost:{page.address.port}"
    form = f"<form method=post action='{page.url}/stop'><button>go</button></form><p>{foreign}</p>"
    one.route(
        "http://127.0.0.1:1/**", lambda route: route.fulfill(content_type="text/html", body=form)
    )
    one.goto("http://127.0.0.1:1/")
    with one.expect_response(f"{page.url}/stop") as answer:
        one.get_by_role("button", name="go").click()
    assert answer.value.status == 403
    assert not house.held


@pytest.mark.process
def test_codes_are_only_for_the_command_line(page):
    """No code without the token of page.json, and none for a browser that somehow has it."""
    assert page.ask("POST", "/code")[0] == 401
    token = {"Authorization": f"Bearer {page.address.token}"}
    assert page.ask("POST", "/code", Origin=page.url, **token)[0] == 401
    assert page.ask("POST", "/code", **token)[0] == 200
    assert (page.run / "page.json").stat().st_mode & 0o077 == 0
    page.paired()
    assert (page.run / "page.paired").stat().st_mode & 0o077 == 0


@pytest.mark.process
def test_requests_are_bounded_but_stop_is_not(page, house):
    """A client that asks without end is refused for a moment, and can stop the robot all the
    same.
    """
    cookie = page.paired()
    said = [page.form("/cancel", {"task": "no-such-task"}, cookie)[0] for _ in range(40)]
    assert said[:5] == [404] * 5
    assert 429 in said
    assert [page.form("/stop", {}, cookie)[0] for _ in range(40)] == [200] * 40
    assert house.held


@pytest.mark.process
def test_where_the_loop_is_elsewhere_hi_is_asked(page, house):
    """Without the loop's file the page sets no flag of its own; what hi says is shown, and its
    tasks are cancelled.
    """
    (house.run / SLOTS_FILE).unlink()
    cookie = page.paired()
    page.form("/say", {"text": "take the jar"}, cookie)
    status, said, _ = page.form("/stop", {}, cookie)
    assert status == 503
    assert b"I cancel all tasks instead" in said
    wait_for(lambda: house.cancelled == ["hi-1-1"], "it is cancelled")


# --- codes ----------------------------------------------------------------------------------------


def test_a_code_ends_with_its_time_its_tries_and_the_next_one(tmp_path):
    """Five wrong ones, five minutes, another code: afterwards it pairs nobody."""
    pairs = Pairs(tmp_path / "paired")
    for wrong, at, paired in (
        (TRIES - 1, CODE_S, True),
        (TRIES, 1.0, False),
        (0, CODE_S + 1.0, False),
    ):
        code = pairs.new_code(0.0)
        other = f"{(int(code) + 1) % 1_000_000:06d}"
        assert [pairs.pair(other, 1.0) for _ in range(wrong)] == [None] * wrong
        assert (pairs.pair(code, at) is not None) == paired, (wrong, at)
    code = pairs.new_code(0.0)
    while pairs.new_code(1.0) == code:
        pass
    assert pairs.pair(code, 2.0) is None


def test_a_paired_browser_is_known_over_a_restart_until_its_time_is_over(tmp_path):
    """And what is on the disk does not make a cookie."""
    pairs = Pairs(tmp_path / "paired")
    cookie = pairs.pair(pairs.new_code(0.0), 0.0)
    again = Pairs(tmp_path / "paired")
    assert again.known(cookie, 10.0)
    assert not again.known(cookie, 10**9)
    (stored,) = msgspec.json.decode((tmp_path / "paired").read_bytes())
    assert not again.known(stored["digest"], 10.0)


def test_a_bucket_lets_a_burst_through_and_then_its_rate():
    """Three at once, then one each half second."""
    bucket = Bucket(3.0, 2.0)
    assert [bucket.take(100.0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take(100.0 + t) for t in (0.4, 0.6, 0.9, 1.1)] == [False, True, False, True]
