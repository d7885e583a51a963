"""The string representation (SC00070I): liberal parser, strict printer, and one typed error with a
position.
"""

import contextlib
import re
from datetime import UTC, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rows import each_row

from fipa_codec.acl_string import (
    MAX_ACL_BYTES,
    MAX_DEPTH,
    MAX_ITEMS,
    AclMessage,
    AclSyntaxError,
    After,
    Aid,
    At,
    parse,
    render,
)
from fipa_codec.acl_string.message import MAX_AFTER_MS, MAX_MS, MIN_MS
from fipa_codec.errors import LocalProtocolError, MalformedError
from fipa_codec.performatives import Performative

INFORM = Performative.INFORM
NOON = At(1_767_268_800_000)  # 2026-01-01 12:00 UTC
KM, PL = Aid(name="km"), Aid(name="pl")


def inform(**fields):
    """Return an inform with these fields."""
    return AclMessage(performative=INFORM, **fields)


# --- strategies -----------------------------------------------------------------------------------

# Edge cases of words: names of JADE's agents, URLs, texts that look like a number, a time or a
# parameter.
EDGES = st.sampled_from(
    [
        *("km", "df@host:1099/JADE", "http://host:7778/acc?a=b&c", "a:sender", "r:content#1"),
        *("NaN", "9f-1", "12d", "x:reply-by20260101T120000000Z", ":language", "-1", "+1", "@a"),
        *("20260101T120000000Z", "#2", "(a)", "é"),
    ]
)
TEXTS = EDGES | st.text(st.sampled_from('"\\ab :()#@-1\n\0é本'), max_size=8) | st.text(max_size=8)
USER = st.dictionaries(
    st.sampled_from(["X-id", "X-JADE-Encoding", "X-é", "x-b"]), TEXTS, max_size=2
)
LEAVES = st.builds(
    Aid, name=TEXTS.filter(bool), addresses=st.lists(TEXTS, max_size=2).map(tuple), user=USER
)
AIDS = LEAVES | st.builds(Aid, name=EDGES, resolvers=st.lists(LEAVES, max_size=2).map(tuple))
SETS = st.lists(AIDS, max_size=2).map(tuple)
TIMES = (
    st.integers(MIN_MS, MAX_MS).map(At)
    | st.integers(-MAX_AFTER_MS, MAX_AFTER_MS).map(After)
    | st.sampled_from([At(MIN_MS), At(MAX_MS), After(MAX_AFTER_MS), After(-1), After(0), NOON])
)
EXPRESSIONS = ("language", "encoding", "ontology", "protocol", "conversation_id", "reply_with",
               "in_reply_to")  # fmt: skip
MESSAGES = st.fixed_dictionaries(
    {"performative": st.sampled_from(Performative)},
    optional={
        **{"sender": AIDS, "receiver": SETS, "reply_to": SETS, "reply_by": TIMES, "user": USER},
        **{"content": TEXTS | st.binary(max_size=8), **dict.fromkeys(EXPRESSIONS, TEXTS)},
    },
).map(lambda fields: AclMessage(**fields))


def assert_message_or_error(data):
    """Check that parse returns a message, which can be printed and parsed again, or only the
    documented error.
    """
    try:
        outcome = parse(data)
    except AclSyntaxError as error:
        outcome = error
    if isinstance(outcome, AclMessage):
        assert parse(render(outcome)) == outcome
        return
    whole = data.encode(errors="replace") if isinstance(data, str) else data
    assert 0 <= outcome.offset <= len(whole)
    assert min(outcome.line, outcome.column) >= 1
    assert 0 <= outcome.caret <= len(outcome.excerpt)
    assert outcome.found
    assert outcome.expected


# --- round trip and strict printing ---------------------------------------------------------------


@given(MESSAGES)
def test_round_trip(message):
    """A printed message parses to an equal one."""
    assert parse(render(message)) == message


def without_strings(data):
    """Return the text with every string replaced by S; an independent implementation of the
    grammar's String.
    """
    out, at = b"", 0
    while at < len(data):
        counted = re.compile(rb'#(\d+)"').match(data, at)
        quoted = re.compile(rb'"(?:\\"|[^"])*?(?<!\\)"', re.DOTALL).match(data, at)
        if counted and data[at - 1 : at] == b" ":
            out, at = out + b"S", counted.end() + int(counted[1])
        elif quoted and data[at - 1 : at] == b" ":
            out, at = out + b"S", quoted.end()
        else:
            out, at = out + data[at : at + 1], at + 1
    return out


@given(MESSAGES)
def test_printing_is_strict(message):
    """Plain words bare, other values as strings, times with Z or sign, blanks before : and ), ASCII
    outside strings.
    """
    text = without_strings(render(message)).decode("utf-8")
    words = text.replace("(", " ( ").split()
    assert not re.search(r"(?<! )\)", text)
    time = r"\d{8}T\d{9}Z|[+-]\d{8}T\d{9}"
    for word in words:
        if not word.startswith(":"):
            assert re.fullmatch(
                rf"[()S]|[A-Za-z][A-Za-z0-9_.@:/?&=%~+-]*|{time}", word, re.ASCII
            ), word


BYTE_EXACT = [
    (AclMessage(performative=Performative.AGREE), b"(agree )"),
    (
        AclMessage(
            performative=Performative.REQUEST,
            content="grasp jar",
            protocol="fipa-request",
            conversation_id="r-1",
            reply_by=NOON,
        ),
        (
            b'(request :content "grasp jar" :protocol fipa-request :conversation-id r-1 :reply-by'
            b" 20260101T120000000Z )"
        ),
    ),
    (
        inform(
            sender=Aid(name="km@host:1099/JADE", addresses=("http://host:7778/acc",)),
            receiver=(PL,),
        ),
        (
            b"(inform :sender (agent-identifier :name km@host:1099/JADE :addresses (sequence"
            b" http://host:7778/acc ) ) :receiver (set (agent-identifier :name pl ) ) )"
        ),
    ),
    (inform(sender=Aid(name="a b")), b'(inform :sender (agent-identifier :name "a b" ) )'),
    (inform(content=""), b'(inform :content "" )'),
    (inform(content='say "hi"'), rb'(inform :content "say \"hi\"" )'),
    (inform(content=r"a\"b"), rb'(inform :content "a\\"b" )'),
    (inform(content="C:\\"), rb'(inform :content #3"C:\ )'),
    (inform(content="é\\", language="raw"), '(inform :content #3"é\\ :language raw )'.encode()),
    (inform(content=b'\xff\x00"'), b'(inform :content #3"\xff\x00" )'),
    (inform(conversation_id="9f-1"), b'(inform :conversation-id "9f-1" )'),
    (inform(conversation_id="12345678d"), b'(inform :conversation-id "12345678d" )'),
    (inform(reply_with="@x", in_reply_to="-x"), b'(inform :reply-with "@x" :in-reply-to "-x" )'),
    (inform(user={"X-id": "km-1-1", "X-t": "1.5"}), b'(inform :X-id km-1-1 :X-t #3"1.5 )'),
    (inform(user={"X-e": "", "X-u": "é"}), '(inform :X-e "" :X-u "é" )'.encode()),
    (inform(reply_by=After(-90_061_001)), b"(inform :reply-by -00000001T010101001 )"),
    (inform(reply_by=After(400 * 86_400_000)), b"(inform :reply-by +00010105T000000000 )"),
]


def test_byte_exact_examples():
    """The printed bytes, one difficulty of the grammar each."""

    def printed(message: AclMessage, data: bytes) -> None:
        assert render(message) == data
        assert parse(data) == message

    each_row(BYTE_EXACT, printed)


def test_messages_that_would_not_parse_are_not_printed():
    """The error is raised at the sender, not at the peer."""

    def unprinted(message, field):
        with pytest.raises(LocalProtocolError) as caught:
            render(message)
        assert caught.value.field == field

    rows = [
        (inform(user={"mood": "good"}), "mood"),
        (inform(user={"X-": "good"}), "X-"),
        (inform(user={"X-a": "1", "x-A": "2"}), "message"),
        (inform(sender=Aid(name="")), "name"),
        (inform(content="\ud800"), "message"),
        (inform(content="x" * MAX_ACL_BYTES), "message"),
        (inform(sender=Aid(name="a", user={"X y": "1"})), "X y"),
        (AclMessage(performative="inform-done"), "performative"),
        (inform(language=7), "message"),
    ]
    each_row(rows, unprinted)


def nested(levels):
    """Return an AID with nested resolvers of this depth."""
    aid = KM
    for _ in range(levels - 1):
        aid = Aid(name="r", resolvers=(aid,))
    return aid


def test_the_depth_limit_is_the_same_for_parser_and_printer():
    """The limit is printed and parsed; one more level is rejected by both."""
    assert parse(render(inform(sender=nested(MAX_DEPTH)))).sender == nested(MAX_DEPTH)
    with pytest.raises(LocalProtocolError):
        render(inform(sender=nested(MAX_DEPTH + 1)))
    one_more = (
        b"(agent-identifier :name r :resolvers (sequence "
        + render(inform(sender=nested(MAX_DEPTH)))[16:-2]
    )
    with pytest.raises(AclSyntaxError, match=f"level {MAX_DEPTH + 1}"):
        parse(b"(inform :sender " + one_more + b")))")
    deep = b"(agent-identifier :name r :resolvers (sequence " * 5000
    with pytest.raises(AclSyntaxError, match="levels"):
        parse(b"(inform :sender " + deep)
    with pytest.raises(AclSyntaxError, match="levels"):
        parse(b"(inform :language " + b"(" * 100_000)


def test_times_outside_the_calendar_cannot_be_made():
    """At and After have the range of the token."""
    for make, value in ((At, MIN_MS - 1), (At, MAX_MS + 1), (After, MAX_AFTER_MS + 1)):
        with pytest.raises(LocalProtocolError):
            make(value)


# --- any text -------------------------------------------------------------------------------------

PIECES = """(|)| |"|\\|\\"|#3"|#0"|#|:|\0|\n|é|(inform |:content |:sender |:receiver |(set |:name |
(agent-identifier |:reply-by |:language |:protocol|:X-a|20260101T120000000Z|abc|12|-|+|@|(sequence |
:addresses|:resolvers """
TOKENS = st.lists(st.sampled_from(PIECES.replace("|\n", "|").split("|")), max_size=40).map("".join)


ANY_BYTES, IN_CONTENT = st.binary(max_size=100), b"(inform :content ".__add__


@given(
    st.text(max_size=60)
    | TOKENS
    | TOKENS.map("(inform {}".format)
    | ANY_BYTES
    | ANY_BYTES.map(IN_CONTENT)
)
def test_any_text_is_a_message_or_a_typed_error(data):
    """Arbitrary characters, tokens of the grammar, also after the act, and arbitrary bytes cause no
    other exception.
    """
    assert_message_or_error(data)


@given(MESSAGES, st.data())
def test_a_truncated_message_is_an_error(message, data):
    """A message ends with the closing parenthesis of its first one."""
    whole = render(message)
    with pytest.raises(AclSyntaxError):
        parse(whole[: data.draw(st.integers(0, len(whole) - 1))])


# --- the parser: accepted texts, rejected texts, and the positions of errors ----------------------

WELL_FORMED = [
    # the grammar, rule by rule, is drawn in test_acl_string_grammar.py; here one of each parameter
    ("(agree)", AclMessage(performative=Performative.AGREE)),
    (
        "(inform :sender (agent-identifier :name km :addresses (sequence http://a:1/acc iiop://b)"
        " :resolvers (sequence (agent-identifier :name pl)) :X-role knows) :reply-to"
        ' (set (agent-identifier :name km)) :content #4"x"(y :ontology (set a "b) c" (d)))',
        inform(
            sender=Aid("km", ("http://a:1/acc", "iiop://b"), (PL,), {"X-role": "knows"}),
            reply_to=(KM,),
            content='x"(y',
            ontology='(set a "b) c" (d))',
        ),
    ),
    (r'(inform :content "a\\"b")', inform(content=r"a\"b")),
    ("(inform :reply-by +00000000T000130250)", inform(reply_by=After(90_250))),
    ("(inform :reply-by -00010100T000000000Z)", inform(reply_by=After(-395 * 86_400_000))),
    ("(inform :reply-by 20260101T120000000)", inform(reply_by=NOON)),
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
    (
        '(inform:protocolcoordinate:conversation-id#2"c1)',
        inform(protocol="coordinate", conversation_id="c1"),
    ),
    (
        "(inform:reply-by20260101T120000000Z:protocolfipa-query)",
        inform(reply_by=NOON, protocol="fipa-query"),
    ),
    (
        '(inform:protocolq:reply-by20260101T120000000Z:X-a#1"b)',
        inform(protocol="q", reply_by=NOON, user={"X-a": "b"}),
    ),
    (
        "(inform:sender(agent-identifier:namekm@h:1:addresses(sequencehttp://h:2/acc)))",
        inform(sender=Aid(name="km@h:1", addresses=("http://h:2/acc",))),
    ),
]


def test_well_formed():
    """Texts of the grammar, and texts as JADE and Rock print them."""

    def read(text: str, message: AclMessage) -> None:
        assert parse(text) == message
        assert parse(text.encode()) == message

    each_row(WELL_FORMED, read)


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


# --- malformed text -------------------------------------------------------------------------------

AGENT = "(agent-identifier :name a"
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
    ("(inform :receiver (agent km))", "receiver", (1, 20), "'agent'", "set"),
    ("(inform :receiver (set km))", "receiver", (1, 24), "'km'", "(agent-identifier"),
    ("(inform :receiver km)", "receiver", (1, 19), "'km'", "(set"),
    ("(inform :sender km)", "sender", (1, 17), "'km'", "(agent-identifier"),
    ("(inform :sender (agent-identifier))", "sender", (1, 34), "')'", ":name"),
    ('(inform :sender (agent-identifier :name ""))', "name", (1, 41), '""', "not empty"),
    (f"(inform :sender {AGENT} :age 3))", "sender", (1, 43), "':age'", ":addresses"),
    (f"(inform :sender {AGENT} :addresses x))", "addresses", (1, 54), "'x'", "(sequence"),
    ("(inform :reply-by soon)", "reply-by", (1, 19), "'soon'", "YYYYMMDDThhmmssmmmZ"),
    ("(inform :reply-by 20260101T120000Z)", "reply-by", (1, 19), "T120000Z", "milliseconds"),
    ("(inform :reply-by 20260101T120000000Zx)", "reply-by", (1, 19), "Zx", "YYYYMMDDThhmmssmmmZ"),
    ("(inform :reply-by 20261301T120000000Z)", "reply-by", (1, 19), "20261301", "month"),
    ("(inform :reply-by 20260230T120000000Z)", "reply-by", (1, 19), "20260230", "calendar"),
    ("(inform :reply-by 20260101T120000000A)", "reply-by", (1, 19), "20260101", "letter Z"),
    ("(inform :reply-by 20260101Z120000000Z)", "reply-by", (1, 19), "0101Z", "YYYYMMDDThh"),
    ("(inform :reply-by +99999999T999999999)", "reply-by", (1, 19), "+9999", "10000 years"),
    ("(inform\n  :language é\n  :mood x)", "message", (3, 3), "':mood'", "one of"),
    ('(inform :content "é本" :mood x)', "message", (1, 23), "':mood'", "one of"),
    ("(inform :language é\ud800)", "message", (1, 20), "surrogate", "UTF-8"),
]


def test_malformed():
    """The error has the position, what was found and what was expected, as attributes and in its
    message.
    """
    each_row(MALFORMED, refused)


def refused(text, field, place, found, expected):
    """Parse it, and look at the error."""
    with pytest.raises(AclSyntaxError) as caught:
        parse(text)
    error = caught.value
    assert (error.field, (error.line, error.column)) == (field, place)
    assert found in error.found
    assert expected in error.expected
    *before, last = text.split("\n")[: error.line]
    last = last[: error.column - 1]
    assert error.offset == len("\n".join((*before, last)).encode())
    where = f"line {error.line}, column {error.column}"
    assert f"{where}: found {error.found}, expected {error.expected}" in str(error)
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
    """Many parameters, escapes or parentheses; a parser with quadratic time exceeds the
    time-out.
    """
    many, long = "".join(f" :X-{number} b" for number in range(9_999)), 1_000_000
    assert len(parse(f"(inform {many})").user) == 9_999
    assert parse(f'(inform :content "{chr(92)}"{many.replace(" ", chr(92) + chr(34))}")').content
    ones = "1" * long + "x"
    for bad in (f'({"(a)" * 100_000} "', ones, f"1e{ones}", ":x-" * 300_000):
        with pytest.raises(AclSyntaxError):
            parse(f"(inform :language {bad}")


@pytest.mark.parametrize(
    "text",
    [
        '(inform :language a:language#1"b' + ":protocola:language#1\"b'" * 12_000 + ")",
        "(inform :language " + "a:language#1" * 500_000 + ")",
        "(inform :sender (agent-identifier :name a :addresses (sequence "
        + "a " * 4_000_000
        + ")))",
        "(inform :language (" + "a " * 4_000_000 + "))",
        "(inform " + ":X-a b " * 1_000_000 + ")",
    ],
)
@pytest.mark.timeout(20)
def test_what_took_half_a_minute_ends_at_once(text):
    """Texts of up to 8 MiB, each of which took 10 to 30 s: one pass, and a limit of items (measured
    2026-11-22).
    """
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
