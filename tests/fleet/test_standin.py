"""After a person spoke in an agent's place: every agent of the system starts from the journal that leaves, as anew."""

import msgspec
from pretended_fleet import NAMES, Fleet

from agent_runtime.impersonation import _record
from companion.design import DESIGN


def test_an_agent_starts_from_the_journal_of_a_stand_in() -> None:
    """With its first memory in its first state, one life later, and numbering on."""
    fleet = Fleet()
    for name in NAMES:
        core = fleet.wires.nodes[name].core
        record = _record(None, name, DESIGN.agent(name).initial)
        record.incarnation, record.issued = 1, {"co": 5}
        state = core.boot(msgspec.msgpack.encode(record))
        first = core.boot(None)
        assert (state.memory, state.state) == (first.memory, first.state), name
        assert (state.incarnation, state.issued) == (2, {"co": 5})
    fleet.close()
