"""Legal ACL texts, drawn from the grammar of SC00070I rule by rule, each with what it means.

A strategy here gives (text, meaning). Nothing of it is taken from the parser or the printer. Left
out are the legal words that `docs/rulings.md` names: with : or " first, and with a parameter of
Rock's inside (`a:content"b"`).
"""

import re
from datetime import UTC, datetime, timedelta

from hypothesis import strategies as st

from fipa_codec.acl_string import AclMessage, After, Aid, At
from fipa_codec.performatives import Performative

BLANKS = "".join(map(chr, range(0x21)))
NO_BLANK = st.text(
    st.characters(exclude_characters=BLANKS + "()", exclude_categories=["Cs"]), max_size=6
)
GAP = st.text(st.sampled_from(BLANKS), min_size=1, max_size=2) | st.just(" ")
NO_GAP = st.just("") | GAP
DIGITS = st.text("0123456789", min_size=1, max_size=6)
SIGN = st.sampled_from(["", "+", "-"])
_ROCKS = re.compile(r':\S*["#]|:reply-by', re.IGNORECASE)


def joined(*parts):
    """Return the texts of these strategies, one after the other."""
    return st.tuples(*parts).map("".join)


def any_case(word):
    """Return the word with each letter in upper or lower case."""
    return st.integers(0, 2 ** len(word) - 1).map(
        lambda upper: "".join(
            c.upper() if upper >> i & 1 else c.lower() for i, c in enumerate(word)
        )
    )


def same(strategy):
    """Return texts that mean what is written."""
    return strategy.map(lambda text: (text, text))


# --- lexical rules --------------------------------------------------------------------------------

_FIRST = st.characters(exclude_characters=BLANKS + '()#0123456789-@":', exclude_categories=["Cs"])
WORD = joined(_FIRST, NO_BLANK).filter(lambda word: not _ROCKS.search(word))
URL = st.from_regex(
    r"[a-z]{1,4}://[A-Za-z0-9.]{1,6}(:[0-9]{1,4})?(/[A-Za-z0-9_.!~*'%&=?;+-]{0,6})?", fullmatch=True
)
EXPONENT = joined(st.sampled_from("eE"), SIGN, DIGITS)
MANTISSA = joined(DIGITS, st.just("."), DIGITS | st.just("")) | joined(st.just("."), DIGITS)
NUMBER = (
    joined(SIGN, DIGITS)
    | joined(SIGN, MANTISSA, EXPONENT | st.just(""))
    | joined(SIGN, DIGITS, EXPONENT)
)
TEXT = st.text(
    st.characters(exclude_categories=["Cs"]) | st.sampled_from('"\\():#\n\0é本'), max_size=8
)
LITERAL = TEXT.filter(lambda text: not text.endswith("\\")).map(
    lambda text: ('"' + text.replace('"', '\\"') + '"', text)
)
COUNTED = st.builds(
    lambda zeros, text: (f'#{zeros}{len(text.encode())}"{text}', text),
    st.text("0", max_size=12),
    TEXT,
)
STRING = LITERAL | COUNTED
ABSOLUTE = st.builds(
    lambda moment, ms, t, letter: (
        f"{moment:{moment.year:04}%m%d{t}%H%M%S}{ms:03}{letter}",
        _unix(moment, ms),
    ),
    st.datetimes(datetime(2, 1, 1), datetime(9998, 12, 31)).map(
        lambda moment: moment.replace(microsecond=0)
    ),
    st.integers(0, 999),
    st.sampled_from("Tt"),
    st.sampled_from(["Z", "z", ""]),
)
RELATIVE = st.builds(
    lambda sign, f, t, letter: (
        f"{sign}{f[0]:04}{f[1]:02}{f[2]:02}{t}{f[3]:02}{f[4]:02}{f[5]:02}{f[6]:03}{letter}",
        After(_amount(*f) * (-1 if sign == "-" else 1)),
    ),
    st.sampled_from("+-"),
    st.tuples(st.integers(0, 9990), *[st.integers(0, 99)] * 5, st.integers(0, 999)),
    st.sampled_from("Tt"),
    st.sampled_from(["Z", "z", ""]),
)
TIME = ABSOLUTE | RELATIVE
# The letter of a time that is kept as written may be any: nobody asks what it means.
TOKEN = joined(SIGN, st.from_regex(r"[0-9]{8}T[0-9]{9}[A-Za-z]?", fullmatch=True))


def _unix(moment, ms):
    return At(
        (moment.replace(tzinfo=UTC) - datetime(1970, 1, 1, tzinfo=UTC))
        // timedelta(seconds=1)
        * 1000
        + ms
    )


def _amount(year, month, day, hour, minute, second, ms):
    return ((((year * 365 + month * 30 + day) * 24 + hour) * 60 + minute) * 60 + second) * 1000 + ms


# --- syntax ---------------------------------------------------------------------------------------


def listed(items, opening):
    """Return texts in parentheses: the opening word, then the items."""
    return st.builds(
        lambda head, found, end: (
            "(" + "".join([head, *(gap + text for gap, (text, _) in found), end, ")"]),
            found,
        ),
        joined(NO_GAP, opening),
        st.lists(st.tuples(GAP, items), max_size=3),
        NO_GAP,
    ).map(lambda drawn: (drawn[0], tuple(meant for _, (_, meant) in drawn[1])))


ATOM = same(WORD | NUMBER | TOKEN)
NESTED = st.recursive(
    ATOM | STRING,
    lambda inner: listed(inner, st.just("")).map(lambda drawn: (drawn[0], drawn[0])),
    max_leaves=6,
)
EXPRESSION = ATOM | STRING | NESTED
USER_NAME = joined(
    st.sampled_from(["X-", "x-"]),
    st.text(
        st.characters(exclude_characters=BLANKS + '()"', exclude_categories=["Cs"]),
        min_size=1,
        max_size=6,
    ),
)
USER = st.lists(
    st.tuples(USER_NAME, EXPRESSION), max_size=2, unique_by=lambda pair: pair[0].lower()
)


@st.composite
def parameters(draw, pairs):
    """Return the text of parameters (name, (text, meaning)), with white space wherever it may be,
    and must be.
    """
    text, before = "", "("
    for name, (value, _) in pairs:
        needed = before not in '")('
        text += draw(GAP if needed else NO_GAP) + ":" + name
        text += draw(NO_GAP if value[0] in '("' else GAP) + value
        before = value[-1] if value[0] in '("' else "a"
    return text + draw(NO_GAP)


SEQUENCE, SET, AGENT = any_case("sequence"), any_case("set"), any_case("agent-identifier")
SLOTS = {slot: any_case(slot) for slot in ("name", "addresses", "resolvers")}
NOTHING = st.just(("", ()))


@st.composite
def identifiers(draw, resolved):
    """Return an agent-identifier: the name, then addresses, resolvers (from `resolved`) and
    user-defined slots.
    """
    slots = {"name": draw(NAMES), "addresses": draw(ADDRESSES), "resolvers": draw(resolved)}
    user = draw(USER)
    written = [(draw(SLOTS[slot]), value) for slot, value in slots.items() if value[0]] + user
    text = "(" + draw(NO_GAP) + draw(AGENT) + draw(GAP) + draw(parameters(written)) + ")"
    return text, Aid(**{slot: meant for slot, (_, meant) in slots.items()}, user=meanings(user))


def meanings(pairs):
    """Return what each name has as its value."""
    return {name: meant for name, (_, meant) in pairs}


NAMES, ADDRESSES = same(WORD), NOTHING | listed(same(URL), SEQUENCE)
AIDS = identifiers(NOTHING)
for _ in range(2):
    AIDS = identifiers(NOTHING | listed(AIDS, SEQUENCE))
SETS = listed(AIDS, SET)
KNOWN = {
    "sender": AIDS,
    "receiver": SETS,
    "reply-to": SETS,
    "content": STRING,
    "reply-by": TIME,
    "protocol": same(WORD),
    **dict.fromkeys(
        ["reply-with", "in-reply-to", "language", "encoding", "ontology", "conversation-id"],
        EXPRESSION,
    ),
}
CASED = {name: any_case(name) for name in KNOWN}
ACTS = {act: any_case(act) for act in Performative}


@st.composite
def messages(draw):
    """Return a message with any of the parameters, in any order."""
    act = draw(st.sampled_from(Performative))
    pairs = [(name, draw(KNOWN[name])) for name in draw(CHOSEN)]
    user = draw(USER)
    written = draw(st.permutations([(draw(CASED[name]), value) for name, value in pairs] + user))
    gaps = draw(NO_GAP), draw(NO_GAP), draw(NO_GAP)
    text = f"{gaps[0]}({gaps[1]}{draw(ACTS[act])}{draw(GAP)}{draw(parameters(written))}){gaps[2]}"
    fields = {name.replace("-", "_"): meant for name, meant in meanings(pairs).items()}
    return text, AclMessage(performative=act, user=meanings(user), **fields)


CHOSEN = st.lists(st.sampled_from(list(KNOWN)), unique=True)
