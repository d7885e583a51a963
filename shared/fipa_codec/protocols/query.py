"""Query: whether a proposition holds (query-if), which object a descriptor denotes (query-ref).

`fipa-query` is that of the specification (SC00027H). `query` is the paper's. There the answer is immediate, so there is
neither agree nor cancel; an initiator that needs no answer any more ignores it. The query may be repeated with the same
m_w until it is answered: each copy may be answered, and later answers are ignored. The paper answers with `inform-ref`
(Table 8), a macro act that the specification does not send (SC00037J); `query` has rows for it and for inform.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.cancelling import cancellable
from fipa_codec.protocols.request import ANSWERS, ENDED, OPEN
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table, register

PLAIN = Kind.PLAIN

_ANSWERS = ((P.INFORM, S.DONE), (P.INFORM_REF, S.DONE), (P.REFUSE, S.REFUSED), (P.FAILURE, S.FAILED))
_QUERIES = (P.QUERY_REF, P.QUERY_IF)
_QUERY_ENDED = (S.DONE, S.REFUSED, S.FAILED)

_query_initiator = Table(
    [
        *(Row(state, SEND, query, PLAIN, S.ASKED) for query in _QUERIES for state in (S.START, S.ASKED)),
        *(Row(S.ASKED, RECEIVE, answer, PLAIN, end) for answer, end in _ANSWERS),
        *(Row(end, RECEIVE, answer, PLAIN, end) for answer, _ in _ANSWERS for end in _QUERY_ENDED),
    ],
    ended=_QUERY_ENDED,
)

_query_participant = Table(
    [
        *(Row(state, RECEIVE, q, PLAIN, S.ASKED) for q in _QUERIES for state in (S.START, S.ASKED, *_QUERY_ENDED)),
        *(Row(S.ASKED, SEND, answer, PLAIN, end) for answer, end in _ANSWERS),
    ],
    ended=_QUERY_ENDED,
)

QUERY = register(Protocol("query", initiator=_query_initiator, participant=_query_participant))
"""The paper's query."""

FIPA_QUERY = register(
    cancellable(
        "fipa-query",
        [*(Row(S.START, SEND, query, PLAIN, S.ASKED) for query in _QUERIES), *ANSWERS],
        ended=ENDED,
        pending=OPEN,
    )
)
"""Query (SC00027H); agree may be omitted if the answer is immediate."""
