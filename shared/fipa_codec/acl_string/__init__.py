"""The FIPA ACL string representation `fipa.acl.rep.string.std` (SC00070I): parser, printer, mapping
to communicates.

    parse(text or bytes) -> AclMessage        liberal: accepts unambiguous deviations of JADE, Rock
    render(AclMessage) -> bytes               strict: every known parser accepts it
    to_acl(communicate) -> AclMessage         and back without loss:
    from_acl(message, received) -> Communicate
    reply_names(message) -> names for to_acl  where a reply-to wants the answers

Modules in reading order: message, text, mapping. No I/O, no clock.
"""

from fipa_codec.acl_string.mapping import Form, from_acl, reply_names, to_acl
from fipa_codec.acl_string.message import (
    MAX_ACL_BYTES,
    MAX_DEPTH,
    MAX_ITEMS,
    AclMessage,
    AclSyntaxError,
    After,
    Aid,
    At,
)
from fipa_codec.acl_string.text import parse, render, render_aid

__all__ = [
    "MAX_ACL_BYTES",
    "MAX_DEPTH",
    "MAX_ITEMS",
    "AclMessage",
    "AclSyntaxError",
    "After",
    "Aid",
    "At",
    "Form",
    "from_acl",
    "parse",
    "render",
    "render_aid",
    "reply_names",
    "to_acl",
]
