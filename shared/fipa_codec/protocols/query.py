"""`query` (FIPA SC00027H): is it true (query-if), which object is it (query-ref).

The answer comes at once, so there is neither agree nor cancel (one who no longer wants the answer drops it). Asking
again, with the same m_w, is free while nothing came: each copy may be answered, and later answers are dropped.

The standard's answer is inform, with a content that says which object the descriptor denotes, or whether the
proposition holds. `inform-ref` is a macro act there (SC00037J); as an answer it is the paper's habit (Table 8). Both
are rows here, for both roles, so that an agent of the paper and one of another platform are understood alike.
"""

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols.naming import register
from fipa_codec.protocols.states import State as S
from fipa_codec.tables import RECEIVE, SEND, Protocol, Row, Table

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

QUERY = register(Protocol("query", initiator=_query_initiator, participant=_query_participant, aliases=("fipa-query",)))
