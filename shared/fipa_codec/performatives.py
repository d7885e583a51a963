"""The 22 communicative acts of FIPA (SC00037J).

`inform-done` and `inform-result` of FIPA's protocol diagrams are uses of `inform`, not acts.
`inform-if` and `inform-ref` are macro acts, which are not sent in FIPA; here they can be, since the
paper answers a query with `inform-ref`.
"""

from enum import StrEnum


class Performative(StrEnum):
    """A communicative act. The value is its name on the wire."""

    ACCEPT_PROPOSAL = "accept-proposal"
    AGREE = "agree"
    CANCEL = "cancel"
    CFP = "cfp"
    CONFIRM = "confirm"
    DISCONFIRM = "disconfirm"
    FAILURE = "failure"
    INFORM = "inform"
    INFORM_IF = "inform-if"
    INFORM_REF = "inform-ref"
    NOT_UNDERSTOOD = "not-understood"
    PROPAGATE = "propagate"
    PROPOSE = "propose"
    PROXY = "proxy"
    QUERY_IF = "query-if"
    QUERY_REF = "query-ref"
    REFUSE = "refuse"
    REJECT_PROPOSAL = "reject-proposal"
    REQUEST = "request"
    REQUEST_WHEN = "request-when"
    REQUEST_WHENEVER = "request-whenever"
    SUBSCRIBE = "subscribe"
