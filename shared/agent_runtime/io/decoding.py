"""From bytes of the wire to events of the core; what cannot be read, or says what its key does not, is Garbled."""

import msgspec

from agent_runtime.core.control import Command
from agent_runtime.core.effects import Receipt
from agent_runtime.core.events import AnyEvent, Arrived, Garbled, Ordered
from agent_runtime.core.recent import receipted
from agent_runtime.io.incoming import Bytes, ReceiptBytes
from fipa_codec.communicate import UNREADABLE, decode
from fipa_codec.errors import MalformedError


def ordered(data: bytes) -> AnyEvent:
    """The order in what came, if it is one."""
    try:
        return Ordered(msgspec.msgpack.decode(data, type=Command))
    except UNREADABLE as error:
        return Garbled("order", str(error))


def arrived(item: Bytes) -> AnyEvent:
    """The communicate in what came, if it is one and says what its key says (the router's rights go by the key)."""
    try:
        communicate = decode(item.data)
    except MalformedError as error:
        return Garbled(item.key, str(error))
    one = communicate
    says = (one.sender, one.receiver, one.protocol, one.performative)
    if item.told != says:
        return Garbled(item.key, f"the communicate says {'/'.join(says)}", forged=True)
    return Arrived(communicate, *item.journals, item.after, item.heard)


def receipt(item: ReceiptBytes) -> AnyEvent:
    """The receipt in what came, if it is one."""
    try:
        told = msgspec.msgpack.decode(item.data, type=Receipt)
    except UNREADABLE as error:
        return Garbled(f"receipt of {item.peer}", str(error))
    return receipted(item.peer, told, *item.journals)
