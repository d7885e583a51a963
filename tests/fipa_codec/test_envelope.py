"""Envelopes: what is packed is unpacked as it was, JADE's are read, and of any bytes nothing but
MalformedError comes.
"""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acl_string import Aid, At
from fipa_codec.envelope import MAX_ENVELOPE_BYTES, Envelope, pack, unpack
from fipa_codec.errors import LocalProtocolError, MalformedError

WORDS = st.text(
    st.characters(min_codepoint=0x21, blacklist_categories=("Cs", "Cc", "Cn")), min_size=1
)
AIDS = st.recursive(
    st.builds(Aid, name=WORDS, addresses=st.lists(WORDS, max_size=2).map(tuple)),
    lambda inner: st.builds(Aid, name=WORDS, resolvers=st.lists(inner, max_size=2).map(tuple)),
    max_leaves=4,
)
SEVERAL = st.lists(AIDS, min_size=1, max_size=3).map(tuple)
ENVELOPES = st.builds(
    Envelope,
    to=SEVERAL,
    sender=AIDS,
    intended=st.just(()) | SEVERAL,
    date=st.none() | st.builds(At, st.integers(0, 4_000_000_000_000)),
)

JADE_TYPE = 'multipart/mixed ; boundary="-----b"'
JADE = (
    b"This is not part of the MIME multipart encoded message.\r\n"
    b"-------b\r\nContent-Type: application/xml\r\n\r\n"
    b'<?xml version="1.0"?>\n<envelope><params index="1">'
    b"<to><agent-identifier><name>hi@roco</name><addresses><url>http://127.0.0.1:8372/acc</url>"
    b"</addresses></agent-identifier></to>"
    b"<from><agent-identifier><name>buyer@lab:1099/JADE</name><addresses>"
    b"<url>http://lab:7778/acc</url></addresses></agent-identifier></from>"
    b"<acl-representation>fipa.acl.rep.string.std</acl-representation>"
    b"<payload-length>10</payload-length><date>20260101Z000000000</date>"
    b"<intended-receiver><agent-identifier><name>hi@roco</name></agent-identifier>"
    b"</intended-receiver></params></envelope>\r\n"
    b"-------b\r\nContent-Type: application/text\r\n\r\n(REQUEST\n)\n"
    b"\r\n-------b--\r\n"
)
BUYER = Aid("buyer@lab:1099/JADE", ("http://lab:7778/acc",))


@given(envelope=ENVELOPES, text=st.binary(max_size=200))
def test_what_is_packed_is_unpacked_as_it_was(envelope, text):
    """Whatever the message: its boundary is not in it."""
    assert unpack(*pack(envelope, text)) == (envelope, text)


def test_an_envelope_of_jade_is_read():
    """A blank before the semicolon, words before the first boundary, a Z for the T."""
    envelope, text = unpack(JADE_TYPE, JADE)
    assert (envelope.sender, envelope.receivers) == (BUYER, (Aid("hi@roco"),))
    assert envelope.date == At(1_767_225_600_000)
    assert text == b"(REQUEST\n)\n"


def test_the_last_stamp_counts():
    """Of each field that it has (SC00067, 2.3.2)."""
    km = b"<agent-identifier><name>km@roco</name></agent-identifier>"
    more = b'<params index="2"><to>' + km + b"</to></params>"
    envelope, _ = unpack(JADE_TYPE, JADE.replace(b"</envelope>", more + b"</envelope>"))
    assert (envelope.to, envelope.sender) == ((Aid("km@roco"),), BUYER)


def test_text_in_an_older_encoding_is_read():
    """It is UTF-8 then."""
    body = JADE.replace(b"<date>", b"<payload-encoding>ISO-8859-1</payload-encoding><date>")
    assert unpack(JADE_TYPE, body.replace(b"REQUEST", b"\xfc"))[1] == "(ü\n)\n".encode()


BOMB = b'<!DOCTYPE e [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><envelope>&b;</envelope>'


@pytest.mark.parametrize(
    ("what", "body", "why"),
    [
        ("text/plain", JADE, "multipart/mixed"),
        (JADE_TYPE.replace("mixed", "form-data"), JADE, "multipart/mixed"),
        ("multipart/mixed", JADE, "boundary"),
        (JADE_TYPE, JADE.replace(b"-----b--", b""), "two parts"),
        (JADE_TYPE, b"", "two parts"),
        (JADE_TYPE, JADE.replace(b"<envelope>", b"<!DOCTYPE envelope><envelope>"), "document type"),
        (JADE_TYPE, re.sub(rb"<\?xml.*</envelope>", BOMB, JADE, flags=re.S), "document type"),
        (JADE_TYPE, JADE.replace(b"</envelope>", b""), "no XML"),
        (JADE_TYPE, JADE.replace(b"string", b"bitefficient"), "acl-representation"),
        (JADE_TYPE, JADE.replace(b"<date>", b"<payload-encoding>zip</payload-encoding><date>"),
         "payload-encoding"),
        (JADE_TYPE, JADE.replace(b"from>", b"for>"), "one agent"),
        (JADE_TYPE, JADE.replace(b"buyer@lab", b"bu yer"), "no word"),
        (JADE_TYPE, JADE.replace(b"<date>", b"<a>" * 100 + b"</a>" * 100 + b"<date>"), "levels"),
        (JADE_TYPE, JADE.replace(b"<date>", b" " * MAX_ENVELOPE_BYTES + b"<date>"), "more than"),
    ],
)  # fmt: skip
def test_what_is_no_envelope_is_refused_with_the_reason(what, body, why):
    """And no entity is ever made."""
    with pytest.raises(MalformedError, match=why):
        unpack(what, body)


@given(what=st.text(max_size=30), body=st.binary(max_size=300))
def test_any_bytes_are_refused_or_read(what, body):
    """No other exception."""
    with pytest.raises(MalformedError):
        unpack(what, body)


@given(data=st.data())
def test_a_changed_envelope_is_refused_or_read(data):
    """Bytes of a good one replaced, wherever."""
    at = data.draw(st.integers(0, len(JADE)))
    junk = data.draw(st.binary(max_size=6) | st.just(b'"'), label="junk")
    body = JADE[:at] + junk + JADE[at + data.draw(st.integers(0, 8)) :]
    try:
        envelope, _ = unpack(JADE_TYPE, body)
    except MalformedError:
        return
    assert envelope.receivers


@pytest.mark.parametrize("name", ["", "a b", "a\x00", "a\n", "\ud800", "\uffff"])
def test_names_that_xml_cannot_hold_are_not_packed(name):
    """The fault is ours."""
    with pytest.raises(LocalProtocolError):
        pack(Envelope(to=(Aid(name),), sender=BUYER), b"")
