"""Texts of JADE 4.6.5 and Rock's fipa_acl are parsed: both printers are written again, here and in
jade.py.
"""

import msgspec
from hypothesis import given
from hypothesis import strategies as st
from jade import WHITE, as_jade

from fipa_codec.acl_string import AclMessage, Aid, At, parse
from fipa_codec.performatives import Performative

NOON = At(1_767_268_800_000)  # 2026-01-01 12:00 UTC
TEXTS = st.text(max_size=20) | st.text(st.sampled_from('"\\ab :()#@-1\n\0é本'), max_size=12)
SAFE = st.from_regex(r"[a-z][a-z0-9_.@-]{0,8}", fullmatch=True)
SAFE_AIDS = st.builds(Aid, name=SAFE, addresses=st.lists(SAFE, max_size=1).map(tuple))
FIELDS = ("language", "encoding", "ontology", "conversation_id", "reply_with", "in_reply_to")
MESSAGES = st.builds(
    AclMessage,
    performative=st.sampled_from(Performative),
    sender=st.none() | SAFE_AIDS,
    receiver=st.lists(SAFE_AIDS, max_size=2).map(tuple),
    reply_to=st.lists(SAFE_AIDS, max_size=1).map(tuple),
    content=st.none() | TEXTS,
    protocol=st.none() | SAFE,
    reply_by=st.none() | st.just(NOON),
    user=st.dictionaries(st.sampled_from(["X-a", "X-b"]), TEXTS, max_size=2),
    **dict.fromkeys(
        FIELDS, st.none() | TEXTS | SAFE | st.from_regex(r"[0-9]{1,4}[dDfF]?", fullmatch=True)
    ),
)


def as_rock(message):
    """Return the message as Rock's fipa_acl prints it: without white space, each expression with
    its length.
    """

    def counted(text):
        return f'#{len(text.encode())}"{text}'

    def aid(one):
        addresses = "".join(f":addresses(sequence{a})" for a in one.addresses)
        return f"(agent-identifier:name{one.name}{addresses})"

    def several(aids):
        return f"(set{''.join(map(aid, aids))})" if aids else ""

    texts = {"content": message.content}
    texts |= {field.replace("_", "-"): getattr(message, field) for field in FIELDS}
    parts = {
        "sender": aid(message.sender) if message.sender else "",
        "receiver": several(message.receiver),
        "reply-to": several(message.reply_to),
        "protocol": message.protocol,
        "reply-by": "20260101T120000000Z" if message.reply_by else "",
        **{n: counted(text) for n, text in (texts | message.user).items() if text is not None},
    }
    written = "".join(f":{name}{text}" for name, text in parts.items() if text)
    return f"({message.performative}{written})"


@given(MESSAGES)
def test_messages_of_rock_are_parsed(message):
    """Without white space: names are joined to words, and words to the next parameter."""
    assert parse(as_rock(message)) == message


def jade_reads(text):
    """Whether JADE prints the text so that it has one meaning: no backslash before a quote, no word
    with : first.
    """
    trimmed = (text or "").strip(WHITE)  # as content is
    return not (trimmed.endswith("\\") or trimmed.startswith(":"))


def unambiguous(message):
    """Whether all its texts are such."""
    fields = [getattr(message, field) for field in FIELDS]
    return all(map(jade_reads, (message.content, *fields, *message.user.values())))


@given(MESSAGES.filter(unambiguous))
def test_messages_of_jade_are_parsed(message):
    """Capitals, two blanks, words and numbers bare, content trimmed, what is empty left out."""
    kept = {field: getattr(message, field) or None for field in FIELDS}
    user = {name: text for name, text in message.user.items() if text}
    content = (message.content or "").strip(WHITE) or None
    assert parse(as_jade(message)) == msgspec.structs.replace(
        message, content=content, user=user, **kept
    )
