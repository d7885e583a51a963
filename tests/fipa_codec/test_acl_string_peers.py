"""Texts of JADE 4.6.5 and Rock's fipa_acl are parsed: both printers are reimplemented here."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from fipa_codec.acl_string import AclMessage, Aid, At, parse
from fipa_codec.performatives import Performative

NOON = At(1_767_268_800_000)  # 2026-01-01 12:00 UTC
TEXTS = st.text(max_size=20) | st.text(st.sampled_from('"\\ab :()#@-1\n\0é本'), max_size=12)
SAFE = st.from_regex(r"[a-z][a-z0-9_.@-]{0,8}", fullmatch=True)
SAFE_AIDS = st.builds(Aid, name=SAFE, addresses=st.lists(SAFE, max_size=1).map(tuple))
SAFE_MESSAGES = st.builds(
    AclMessage,
    performative=st.sampled_from(Performative),
    sender=st.none() | SAFE_AIDS,
    receiver=st.lists(SAFE_AIDS, max_size=2).map(tuple),
    content=st.none() | TEXTS,
    language=st.none() | TEXTS,
    protocol=st.none() | SAFE,
    conversation_id=st.none() | TEXTS,
    reply_by=st.none() | st.just(NOON),
    user=st.dictionaries(st.sampled_from(["X-a", "X-b"]), TEXTS, max_size=2),
)


def as_rock(message):
    """Return the message as Rock's fipa_acl prints it: without white space, each expression with its length."""

    def counted(text):
        return f'#{len(text.encode())}"{text}'

    def aid(one):
        return f"(agent-identifier:name{one.name}" + "".join(f":addresses(sequence{a})" for a in one.addresses) + ")"

    return "".join(
        [
            f"({message.performative}",
            *([f":sender{aid(message.sender)}"] if message.sender else []),
            *([f":receiver(set{''.join(map(aid, message.receiver))})"] if message.receiver else []),
            *([f":protocol{message.protocol}"] if message.protocol else []),
            *([":reply-by20260101T120000000Z"] if message.reply_by else []),
            *(
                f":{name}{counted(text)}"
                for name, text in (
                    ("content", message.content),
                    ("language", message.language),
                    ("conversation-id", message.conversation_id),
                    *message.user.items(),
                )
                if text is not None
            ),
            ")",
        ]
    )


def as_jade(message):
    """Return the message as JADE prints it: act in capitals, two blanks, text quoted, empty content omitted."""

    def aid(one):
        addresses = f" :addresses (sequence {' '.join(one.addresses)} )" if one.addresses else ""
        return f"( agent-identifier :name {one.name} {addresses})"

    def quoted(text):
        return '"' + text.replace('"', '\\"') + '"'

    return "\n".join(
        [
            f"({message.performative.upper()}",
            *([f" :sender  {aid(message.sender)}"] if message.sender else []),
            *([f" :receiver  (set {' '.join(map(aid, message.receiver))} )"] if message.receiver else []),
            *([f" :content  {quoted(message.content)} "] if message.content else []),
            *([f"  :language  {quoted(message.language)} "] if message.language is not None else []),
            *([f"  :protocol  {message.protocol} "] if message.protocol else []),
            *(
                [f"  :conversation-id  {quoted(message.conversation_id)} "]
                if message.conversation_id is not None
                else []
            ),
            *(["  :reply-by  20260101T120000000Z "] if message.reply_by else []),
            *(f"  :{name} {quoted(text)}" for name, text in message.user.items()),
            " )",
        ]
    )


@given(SAFE_MESSAGES)
def test_messages_of_rock_are_parsed(message):
    """Without white space: names are joined to words, and words to the next parameter."""
    assert parse(as_rock(message)) == message


def parses_quoted(text):
    """Whether JADE can parse its own quoted form of the text, which may not end in a backslash."""
    return text is None or not text.endswith("\\")


@given(
    SAFE_MESSAGES.filter(
        lambda m: all(map(parses_quoted, (m.content, m.language, m.conversation_id, *m.user.values())))
    )
)
def test_messages_of_jade_are_parsed(message):
    """Capitals, two blanks, empty content omitted."""
    assert parse(as_jade(message)) == msgspec.structs.replace(message, content=message.content or None)
