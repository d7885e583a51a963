"""Printer of ACL messages: strict, in the subset that both JADE and Rock parse.

Plain words are bare, other text is quoted, absolute times are in UTC with Z, a blank is before each : and ). A string
that ends in a backslash cannot be quoted and is printed with its length in bytes. So are ASCII values of X- parameters
that are not plain words: Rock does not parse quoted ones, and JADE counts characters, so only ASCII is safe.
"""

import re
from collections.abc import Iterator

from fipa_codec.acl_string.message import MAX_DEPTH, AclMessage, Aid, print_date
from fipa_codec.acl_string.reading import RUN_ON, parse
from fipa_codec.errors import LocalProtocolError, MalformedError

_PLAIN_EXPRESSION = re.compile(r"[A-Za-z][A-Za-z0-9_.@-]*")
# Names of agents and URLs are words in the grammar, with more characters: df@host:1099/JADE
_PLAIN_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_.@:/?&=%~+-]*")
_USER_NAME = re.compile(r'[Xx]-[^\x00-\x20()"]+')


def render(message: AclMessage) -> bytes:
    """Return the text, in UTF-8 except for binary content.

    Raise LocalProtocolError if it would not parse to `message`.
    """
    try:
        data = b" ".join([b"(" + message.performative.encode(), *_parameters(message), b")"])
        same = parse(data) == message
    except UnicodeEncodeError as error:
        raise LocalProtocolError("message", "contains half a surrogate pair, which UTF-8 cannot encode") from error
    except (AttributeError, TypeError) as error:
        raise LocalProtocolError("message", f"has a field of the wrong type: {error}") from error
    except MalformedError as error:
        raise LocalProtocolError(error.field, f"cannot be parsed again: {error.reason}") from error
    if not same:
        raise LocalProtocolError("message", "does not parse to the same message: a field has the wrong type")
    return data


def _parameters(message: AclMessage) -> Iterator[bytes]:
    if message.sender:
        yield b":sender " + _aid(message.sender)
    for name, aids in ((b":receiver ", message.receiver), (b":reply-to ", message.reply_to)):
        if aids:
            yield name + _several(b"set", [_aid(aid) for aid in aids])
    if message.content is not None:
        yield b":content " + _content(message.content)
    for field in ("language", "encoding", "ontology", "protocol", "conversation_id", "reply_with", "in_reply_to"):
        value = getattr(message, field)
        if value is not None:
            begin = f":{field.replace('_', '-')} ".encode()
            yield begin + (_word(value) if field == "protocol" else _expression(value))
    if message.reply_by is not None:
        yield b":reply-by " + print_date(message.reply_by).encode()
    yield from _user(message.user)


def _aid(aid: Aid, depth: int = 0) -> bytes:
    if depth >= MAX_DEPTH:
        raise LocalProtocolError("resolvers", f"are nested more than {MAX_DEPTH} deep")
    parts = [b"(agent-identifier :name", _word(aid.name)]
    if aid.addresses:
        parts += [b":addresses", _several(b"sequence", [_word(address) for address in aid.addresses])]
    if aid.resolvers:
        parts += [b":resolvers", _several(b"sequence", [_aid(resolver, depth + 1) for resolver in aid.resolvers])]
    return b" ".join([*parts, *_user(aid.user), b")"])


def _several(keyword: bytes, items: list[bytes]) -> bytes:
    return b" ".join([b"(" + keyword, *items, b")"])


def _user(parameters: dict[str, str]) -> Iterator[bytes]:
    for name, value in parameters.items():
        if not _USER_NAME.fullmatch(name):
            raise LocalProtocolError(
                name, 'is not the name of a user-defined parameter: X- and characters other than blank ( ) "'
            )
        if _PLAIN_EXPRESSION.fullmatch(value):
            text = value.encode()
        else:
            text = _counted(value.encode()) if value.isascii() and value else _quoted(value)
        yield f":{name} ".encode() + text


def _word(text: str) -> bytes:
    plain = _PLAIN_WORD.fullmatch(text) and not RUN_ON.search(text.encode())
    return text.encode() if plain else _quoted(text)


def _expression(text: str) -> bytes:
    return text.encode() if _PLAIN_EXPRESSION.fullmatch(text) else _quoted(text)


def _content(content: str | bytes) -> bytes:
    return _counted(content) if isinstance(content, bytes) else _quoted(content)


def _quoted(text: str) -> bytes:
    data = text.encode()
    return _counted(data) if data.endswith(b"\\") else b'"' + data.replace(b'"', b'\\"') + b'"'


def _counted(data: bytes) -> bytes:
    return b'#%d"%s' % (len(data), data)
