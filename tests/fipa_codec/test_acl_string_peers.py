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
        return (
            f"(agent-identifier:name{one.name}"
            + "".join(f":addresses(sequence{a})" for a in one.addresses)
            + ")"
        )

    return "".join(
        [
            f"({message.performative}",
            *([f":sender{aid(message.sender)}"] if message.sender else []),
            *([f":receiver(set{''.join(map(aid, message.receiver))})"] if message.receiver else []),
            *([f":reply-to(set{''.join(map(aid, message.reply_to))})"] if message.reply_to else []),
            *([f":protocol{message.protocol}"] if message.protocol else []),
            *([":reply-by20260101T120000000Z"] if message.reply_by else []),
            *(
                f":{name}{counted(text)}"
                for name, text in (
                    ("content", message.content),
                    *((field.replace("_", "-"), getattr(message, field)) for field in FIELDS),
                    *message.user.items(),
                )
                if text is not None
            ),
            ")",
        ]
    )


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


@given(
    MESSAGES.filter(
        lambda m: all(
            map(jade_reads, (m.content, *map(m.__getattribute__, FIELDS), *m.user.values()))
        )
    )
)
def test_messages_of_jade_are_parsed(message):
    """Capitals, two blanks, words and numbers bare, content trimmed, what is empty left out."""
    kept = {field: getattr(message, field) or None for field in FIELDS}
    user = {name: text for name, text in message.user.items() if text}
    content = (message.content or "").strip(WHITE) or None
    assert parse(as_jade(message)) == msgspec.structs.replace(
        message, content=content, user=user, **kept
    )
