"""Simplifications of the composed model: why each is safe, and the evidence for it.

`roco design verify --long` prints this table; a reader who doubts a verdict begins here.
"""

from typing import NamedTuple


class Abstraction(NamedTuple):
    """`what` is done to the running system to get the model; `why` no error is hidden by it;
    `shown` by what.
    """

    what: str
    why: str
    shown: str


ABSTRACTIONS = (
    Abstraction(
        "contents of messages are dropped",
        "a row offers every reaction that some content may cause, so the model does more than the"
        " agents, never less",
        "each step of a running agent is compared with its rows (topdown.judge.steps)",
    ),
    Abstraction(
        "words that change nothing (progress told and confirmed) are not sent",
        "their receiver stands as before after taking them, in every state in which they may come",
        "topdown.prove.parts, and Fleet.not_silent after the exploration, over every state that was"
        " reached",
    ),
    Abstraction(
        "words under `may` are not said",
        "they are such silent words, or questions of whose answer nobody waits",
        "the design's author; checked are tables (a row for the answer in the state that follows)"
        " and running steps",
    ),
    Abstraction(
        "a durable stream is an ideal FIFO queue",
        "numbered, journalled, re-sent: nothing is lost, doubled or overtaken, whatever dies",
        "layer 1, under any number of faults; layer 2 with copies and receipts explicit",
    ),
    Abstraction(
        "a death and the coming back are one step, and faults are explored from rest",
        "while an agent is down its queues only wait; the start of all agents is explored by"
        " itself, without faults",
        "layers 1 and 2 let a side die between any two of its micro-steps",
    ),
    Abstraction(
        "a volatile channel is a set of words; what belongs to a question given up is dropped at"
        " once",
        "copies of one word do the same; a late answer is dropped by the conversation's id whenever"
        " it comes",
        "layer 2, volatile: copies explicit",
    ),
    Abstraction(
        "a question is asked again only when nothing of it is on its way",
        "asking earlier makes copies, and copies are explored as faults",
        "layer 2, volatile",
    ),
    Abstraction(
        "the receipt of an observation comes with its taking, or is lost",
        "a receipt that comes later is an observation taken later: until then it is owed in both",
        "layer 2, latest: receipts explicit",
    ),
    Abstraction(
        "one observation stands for all subjects",
        "what is owed is a yes or no to whoever waits for all of it; no order among subjects is"
        " relied on",
        "agent_runtime: observations of every subject are kept and re-sent alike"
        " (tests/agent_runtime)",
    ),
    Abstraction(
        "a group says anything that the tables of its uses and the acts of its messages allow, at"
        " any time",
        "it does more than any group that keeps to its tables; nobody may wait for what it opens or"
        " calls off",
        "topdown.prove.chaos; each row that a group's word needs is taken away"
        " (tests/topdown/test_proving_groups.py)",
    ),
    Abstraction(
        "a wait may be over at any time, and no time passes",
        "every order of ends of waits and messages is explored, so no duration is relied on",
        "by construction; nothing is said of durations",
    ),
)

NOT_PROVEN = (
    (
        "several conversations of one use at a time (rows marked `several`): several commands,"
        " parallel plans"
    ),
    "not-understood in the composed system; each protocol is explored with it alone",
    "durations, fairness of the scheduler, and loops of a plan (next act, new plan) that never end",
    "a journal that is lost or lies; a process that hangs and does not die",
    "waits of a publisher for a subscriber that is gone for good (`late` of a latest use)",
    (
        "that what is named happens: a worker that says nothing after a death, a message left in"
        " the inbox for ever"
    ),
    (
        "a volatile question that was given up, or is older than its reply-by, and reaches a server"
        " that is slow to answer"
    ),
    (
        "a peer that seems to come back though it never died (the router was away), but for what"
        " its death brings about"
    ),
    (
        "how long a queue gets by words that change nothing (progress), which are not sent in the"
        " model: the bound is proven for all other words; a full outbox holds the sender back"
    ),
    "that a group (an end that the design gives no rows) answers what it is asked, sooner or later",
    (
        "two agents whose outboxes are full towards each other, which only many reports that nobody"
        " asked for bring about"
    ),
)
"""Limits: properties that no layer covers."""
