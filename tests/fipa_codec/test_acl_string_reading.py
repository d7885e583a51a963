"""The parser of the string representation (SC00070I): accepted texts, rejected texts, and the positions of errors."""

import contextlib
from datetime import UTC, timedelta, timezone

import pytest

from fipa_codec.acl_string import MAX_ACL_BYTES, MAX_ITEMS, AclMessage, AclSyntaxError, After, Aid, At, parse
from fipa_codec.errors import MalformedError
from fipa_codec.performatives import Performative

NOON = At(1_767_268_800_000)  # 2026-01-01 12:00 UTC
KM, PL = Aid(name="km"), Aid(name="pl")


def inform(**fields):
    """Return an inform with these fields."""
    return AclMessage(performative=Performative.INFORM, **fields)


WELL_FORMED = [
    # the grammar
    ("(agree)", AclMessage(performative=Performative.AGREE)),
    (
        '(request :content "grasp jar" :reply-by 20260704T101500250Z :protocol fipa-request :conversation-id r-1)',
        AclMessage(
            performative=Performative.REQUEST,
            content="grasp jar",
            reply_by=At(1_783_160_100_250),
            protocol="fipa-request",
            conversation_id="r-1",
        ),
    ),
    ('(inform :content #4"x"(y :language raw)', inform(content='x"(y', language="raw")),
    ("  (\n inform\t:language\r\nSW )\n ", inform(language="SW")),
    ('(inform :content "")', inform(content="")),
    ('(inform :content #0")', inform(content="")),
    (r'(inform :content "a\b\\c")', inform(content=r"a\b\\c")),
    (r'(inform :content "a\\"b")', inform(content=r"a\"b")),
    ('(inform :content "a\nb ) :x")', inform(content="a\nb ) :x")),
    ('(inform :content #3"a\\" :language b)', inform(content='a\\"', language="b")),
    ('(inform :content #4"gr\u00f6 :language x)', inform(content="grö", language="x")),
    ("(inform :reply-with 42 :in-reply-to -1.5e3)", inform(reply_with="42", in_reply_to="-1.5e3")),
    ("(inform :reply-with 20260101T120000000Z)", inform(reply_with="20260101T120000000Z")),
    ('(inform :ontology (set a "b) c" (d)))', inform(ontology='(set a "b) c" (d))')),
    ("(inform :X-mood (very good) :X-n 3)", inform(user={"X-mood": "(very good)", "X-n": "3"})),
    ("(inform :receiver (set (agent-identifier :name km) (agent-identifier :name pl)))", inform(receiver=(KM, PL))),
    ("(inform :reply-to (set (agent-identifier :name km)))", inform(reply_to=(KM,))),
    (
        "(inform :sender (agent-identifier :name km :addresses (sequence http://a:1/acc iiop://b) "
        ":resolvers (sequence (agent-identifier :name pl)) :X-role knows))",
        inform(
            sender=Aid(name="km", addresses=("http://a:1/acc", "iiop://b"), resolvers=(PL,), user={"X-role": "knows"})
        ),
    ),
    ("(inform :reply-by +00000000T000130250)", inform(reply_by=After(90_250))),
    ("(inform :reply-by -00010100T000000000Z)", inform(reply_by=After(-395 * 86_400_000))),
    ("(inform :reply-by 20260101T120000000)", inform(reply_by=NOON)),
    ("(inform :language größe)", inform(language="größe")),
    ("(inform :protocol a:b)", inform(protocol="a:b")),
    ("(inform :protocol a:sender)", inform(protocol="a:sender")),
    # as JADE prints it
    ('(INFORM :Content  "a" :LANGUAGE SW)', inform(content="a", language="SW")),
    ("(Inform :sender ( Agent-Identifier :NAME km  :addresses (Sequence )))", inform(sender=KM)),
    ('(inform :sender (agent-identifier :name "km"))', inform(sender=KM)),
    ("(inform :conversation-id 12345678d)", inform(conversation_id="12345678d")),
    ("(inform :language @x)", inform(language="@x")),
    ("(inform :content hello)", inform(content="hello")),
    ("(inform :language a :language b)", inform(language="b")),
    ("(inform :X-a 1 :x-A 2)", inform(user={"x-A": "2"})),
    ("(inform :X-a 1 :x-A 2 :X-a 3)", inform(user={"X-a": "3"})),
    ("(inform :X-JADE-Encoding Base64)", inform(user={"X-JADE-Encoding": "Base64"})),
    ("(inform :reply-by 20260101t120000000z)", inform(reply_by=NOON)),
    # as Rock prints it
    ("(inform :receiver (set))", inform()),
    (
        '(inform:sender(agent-identifier:namekm):receiver(set(agent-identifier:namepl)):language#2"SW)',
        inform(sender=KM, receiver=(PL,), language="SW"),
    ),
    ('(inform:protocolcoordinate:conversation-id#2"c1)', inform(protocol="coordinate", conversation_id="c1")),
    ("(inform:reply-by20260101T120000000Z:protocolfipa-query)", inform(reply_by=NOON, protocol="fipa-query")),
    ('(inform:protocolq:reply-by20260101T120000000Z:X-a#1"b)', inform(protocol="q", reply_by=NOON, user={"X-a": "b"})),
    (
        "(inform:sender(agent-identifier:namekm@h:1:addresses(sequencehttp://h:2/acc)))",
        inform(sender=Aid(name="km@h:1", addresses=("http://h:2/acc",))),
    ),
]


@pytest.mark.parametrize(("text", "message"), WELL_FORMED)
def test_well_formed(text, message):
    """Texts of the grammar, and texts as JADE and Rock print them."""
    assert parse(text) == message
    assert parse(text.encode()) == message


def test_content_that_is_not_utf_8_stays_bytes():
    """A byte-length string may have any bytes; UTF-8 is decoded."""
    assert parse(b'(inform :content #2"\xff" )').content == b'\xff"'
    assert inform(content=b"abc") == inform(content="abc")


def test_a_time_without_letter_is_in_the_senders_zone():
    """The caller passes the zone."""
    text = "(inform :reply-by 20260101T120000000)"
    assert parse(text, zone=UTC).reply_by == NOON
    assert parse(text, zone=timezone(timedelta(hours=2))).reply_by == At(NOON.unix_ms - 7_200_000)
    assert parse(text.replace(")", "Z)"), zone=timezone(timedelta(hours=2))).reply_by == NOON
    with pytest.raises(AclSyntaxError, match="years 1 to 9999"):
        parse("(inform :reply-by 00010101T000000000)", zone=timezone(timedelta(hours=2)))


# --- malformed text ---------------------------------------------------------------------------------------------------

MALFORMED = [
    # text, field, (line, column), found, expected
    ("", "message", (1, 1), "end of the text", "( and the act"),
    ("inform", "message", (1, 1), "'inform'", "( and the act"),
    ("()", "performative", (1, 2), "')'", "an act of SC00037J"),
    ("(inform-done)", "performative", (1, 2), "'inform-done'", "inform-ref"),
    ('("inform")', "performative", (1, 2), "inform", "an act"),
    ("(inform", "message", (1, 8), "end of the text", ") at the end"),
    ("(inform) (agree)", "message", (1, 10), "'('", "only one message"),
    ("(inform content)", "message", (1, 9), "'content'", "begins with :"),
    ("(inform :mood good)", "message", (1, 9), "':mood'", ":conversation-id"),
    ("(inform :X- good)", "message", (1, 9), "':X-'", ":X- and a name"),
    ("(inform : language x)", "message", (1, 9), "':'", "one of"),
    ("(inform :protocols fipa-request)", "message", (1, 9), "':protocols'", ":protocol"),
    ("(inform :language)", "language", (1, 18), "')'", "a word"),
    ("(inform :language :content)", "language", (1, 19), "':content'", "a word"),
    ("(inform :language 2pc)", "language", (1, 19), "'2pc'", "in quotes"),
    ("(inform :language -x)", "language", (1, 19), "'-x'", "in quotes"),
    ("(inform :protocol 2pc)", "protocol", (1, 19), "'2pc'", "digit"),
    ("(inform :language a b)", "message", (1, 21), "'b'", "begins with :"),
    ("(inform :language (a (b))", "message", (1, 26), "end of the text", ") at the end"),
    ("(inform :language (a b", "language", (1, 23), "end of the text", ") that ends"),
    ('(inform :content "abc)', "content", (1, 18), "without end", "a quote"),
    ('(inform :content "ends in \\")', "content", (1, 18), "without end", "#<bytes>"),
    ("(inform :content (done a))", "content", (1, 18), "'('", "in quotes"),
    ('(inform :content #5"abc)', "content", (1, 18), "5 bytes", "at most 4 bytes"),
    ('(inform :content #"abc")', "content", (1, 18), "#", "#<bytes>"),
    ('(inform :content #9999999999999"a)', "content", (1, 18), "#", "9 digits"),
    ('(inform :content #3"abcd)', "message", (1, 24), "'d'", "begins with :"),
    ("(inform :receiver (agent-identifier :name km))", "receiver", (1, 20), "'agent-identifier'", "set"),
    ("(inform :receiver (set km))", "receiver", (1, 24), "'km'", "(agent-identifier"),
    ("(inform :receiver km)", "receiver", (1, 19), "'km'", "(set"),
    ("(inform :sender km)", "sender", (1, 17), "'km'", "(agent-identifier"),
    ("(inform :sender (agent-identifier))", "sender", (1, 34), "')'", ":name"),
    ('(inform :sender (agent-identifier :name ""))', "name", (1, 41), '""', "not empty"),
    ("(inform :sender (agent-identifier :name a :age 3))", "sender", (1, 43), "':age'", ":addresses"),
    ("(inform :sender (agent-identifier :name a :addresses http://x))", "addresses", (1, 54), "'http", "(sequence"),
    ("(inform :reply-by soon)", "reply-by", (1, 19), "'soon'", "YYYYMMDDThhmmssmmmZ"),
    ("(inform :reply-by 20260101T120000Z)", "reply-by", (1, 19), "20260101T120000Z", "milliseconds"),
    ("(inform :reply-by 20260101T120000000Zx)", "reply-by", (1, 19), "Zx", "YYYYMMDDThhmmssmmmZ"),
    ("(inform :reply-by 20261301T120000000Z)", "reply-by", (1, 19), "20261301", "month"),
    ("(inform :reply-by 20260230T120000000Z)", "reply-by", (1, 19), "20260230", "calendar"),
    ("(inform :reply-by 20260101T120000000A)", "reply-by", (1, 19), "20260101", "letter Z"),
    ("(inform :reply-by 20260101Z120000000Z)", "reply-by", (1, 19), "20260101Z", "YYYYMMDDThhmmssmmmZ"),
    ("(inform :reply-by +99999999T999999999)", "reply-by", (1, 19), "+9999", "10000 years"),
    ("(inform\n  :language é\n  :mood x)", "message", (3, 3), "':mood'", "one of"),
    ('(inform :content "é本" :mood x)', "message", (1, 23), "':mood'", "one of"),
    ("(inform :language é\ud800)", "message", (1, 20), "surrogate", "UTF-8"),
]


@pytest.mark.parametrize(("text", "field", "place", "found", "expected"), MALFORMED)
def test_malformed(text, field, place, found, expected):
    """The error has the position, what was found and what was expected, as attributes and in its message."""
    with pytest.raises(AclSyntaxError) as caught:
        parse(text)
    error = caught.value
    assert (error.field, (error.line, error.column)) == (field, place)
    assert found in error.found
    assert expected in error.expected
    before = "\n".join(text.split("\n")[: error.line])
    last = before.rpartition("\n")[2]
    assert error.offset == len(before[: len(before) - len(last) + error.column - 1].encode())
    assert f"line {error.line}, column {error.column}: found {error.found}, expected {error.expected}" in str(error)
    assert isinstance(error, MalformedError)
    assert error.performative is Performative.NOT_UNDERSTOOD


def test_bytes_that_are_not_utf_8_are_reported_with_their_position():
    """Only content may have such bytes; the column counts characters, the offset bytes."""
    with pytest.raises(AclSyntaxError) as caught:
        parse('(inform :content "é" :language "a\\"b'.encode() + b'\xff")')
    assert caught.value.field == "language"
    assert caught.value.found == "byte ff"
    assert (caught.value.column, caught.value.offset) == (37, 37)


def test_too_long_text_is_rejected_before_it_is_parsed():
    """The size limit applies."""
    with pytest.raises(AclSyntaxError, match="at most"):
        parse(b"(inform :content " + b"(" * MAX_ACL_BYTES)


def test_parsing_takes_linear_time():
    """Many parameters, escapes or parentheses; a parser with quadratic time exceeds the time-out."""
    many = "".join(f" :X-{number} b" for number in range(9_999))
    assert len(parse(f"(inform {many})").user) == 9_999
    assert parse(f'(inform :content "{chr(92)}"{many.replace(" ", chr(92) + chr(34))}")').content
    for bad in (f'({"(a)" * 100_000} "', "1" * 1_000_000 + "x", f"1e{'1' * 1_000_000}x", ":x-" * 300_000):
        with pytest.raises(AclSyntaxError):
            parse(f"(inform :language {bad}")


@pytest.mark.parametrize(
    "text",
    [
        '(inform :language a:language#1"b' + ":protocola:language#1\"b'" * 12_000 + ")",
        "(inform :language " + "a:language#1" * 500_000 + ")",
        "(inform :sender (agent-identifier :name a :addresses (sequence " + "a " * 4_000_000 + ")))",
        "(inform :language (" + "a " * 4_000_000 + "))",
        "(inform " + ":X-a b " * 1_000_000 + ")",
    ],
)
@pytest.mark.timeout(20)
def test_what_took_half_a_minute_ends_at_once(text):
    """Texts of up to 8 MiB, each of which took 10 to 30 s: one pass, and a limit of items (measured 2026-11-22)."""
    with contextlib.suppress(AclSyntaxError):
        parse(text)


def test_a_text_has_a_limited_number_of_items():
    """The error says which limit; one less is read."""
    members = "a " * (MAX_ITEMS - 4)
    text = "(inform :sender (agent-identifier :name a :addresses (sequence {})))"
    assert parse(text.format(members)).sender
    with pytest.raises(AclSyntaxError, match="at most 10000 parameters and members"):
        parse(text.format(members + "a a a a a"))


def test_the_excerpt_of_a_long_line_is_short_and_has_the_error():
    """The caret is an index into the excerpt."""
    text = '(inform :content "' + "é" * 10_000 + '" :mood ' + "x" * 10_000
    with pytest.raises(AclSyntaxError) as caught:
        parse(text)
    assert len(caught.value.excerpt) <= 120
    assert caught.value.excerpt[caught.value.caret :].startswith(":mood")
