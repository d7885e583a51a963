"""What a guest is offered: all that its rows allow, and nothing of what they withhold."""

import jsonschema
import pytest

from companion import commands
from companion.design import DESIGN, LANGUAGES
from companion.languages import wm
from companion.languages.cmd import MOST_CHARACTERS, Sentence
from operate.guests.offers import ArgumentError, offers, reader

OFFERS = {one.name: one for one in offers(DESIGN, LANGUAGES, "assistant")}
WITHHELD = set(DESIGN.guests["assistant"].withheld)


def test_each_task_and_each_question_is_an_offer():
    """A task that is added is offered without another line."""
    wished = {one.content for one in OFFERS.values() if one.consent}
    assert wished == {row.content for row in commands.rows()}
    asked = {one.content for one in OFFERS.values() if one.question}
    known = set(wm.Query.__subclasses__()) - {wm.HypotheticalState, wm.DropStates}
    assert asked == {*known, Sentence}


def test_sentences_are_read_by_the_offer_that_the_commands_answer():
    """Without a row for it, or the commands, nothing does."""
    found = reader(OFFERS.values())
    assert found is OFFERS["understand"]
    assert found.read({"text": "take the jar"}) == Sentence("take the jar")
    assert reader(one for one in OFFERS.values() if one is not found) is None
    assert reader(one for one in OFFERS.values() if one.question) is None
    for text in ("", "a" * (MOST_CHARACTERS + 1), 3, None):
        with pytest.raises(ArgumentError):
            found.read({"text": text})


@pytest.mark.parametrize("offer", OFFERS.values(), ids=str)
def test_a_schema_is_one_and_has_nothing_that_is_withheld(offer):
    """Its arguments are those that it reads."""
    jsonschema.Draft202012Validator.check_schema(offer.schema)
    assert not {*offer.schema["properties"], "type"} & WITHHELD
    assert "type" not in offer.schema["properties"]
    assert offer.text
    for name in (*WITHHELD, "type", "__class__"):
        with pytest.raises(ArgumentError, match=f"takes no {name}"):
            offer.read({name: 9})


def test_arguments_are_read_by_the_class():
    """Where something is missing or of another type, the reason names it."""
    pour = OFFERS["pour"]
    content = pour.read({"source": "jar", "destination": "bowl"})
    assert (content.source, content.destination, content.urgency) == ("jar", "bowl", 0)
    for arguments, why in (
        ({"source": "jar"}, "destination"),
        ({"source": "jar", "destination": 3}, "str"),
        ({"source": ["jar"], "destination": "bowl"}, "str"),
    ):
        with pytest.raises(ArgumentError, match=why):
            pour.read(arguments)
