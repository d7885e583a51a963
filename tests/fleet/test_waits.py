"""Every wait ends: by an answer, or by its time and in words that say whose answer did not come."""

from pretended_fleet import Fleet
from scripted_search import Script

from agent_runtime.testing.memory_bus import Point
from companion.languages import wm
from companion.languages.facts import Kind, fact
from services.planner.search import Answer, Begin, Died


def test_an_empty_world(fleet):
    """The plan fails with its reason if nothing is seen: km knows only what observations told
    it.
    """
    fleet.world.poses.clear()
    fleet.say()
    assert fleet.finish() == ["failed"]
    assert fleet.why()[0] == fact(Kind.NOT_SEEN, "jar")
    fleet.say("look around")
    assert fleet.finish(2)[-1] == "done"


def test_no_question_is_answered_before_the_first_look(fleet):
    """A command that comes before anything was seen waits for the look around instead of
    failing.
    """
    fleet.wires.crash("ex", Point.BEFORE, in_steps=1, restart_s=8.0)
    fleet.say()
    assert fleet.finish() == ["done"]


def test_blind_for_good(fleet):
    """Without a robot km answers that nothing was observed, once its patience is over."""
    fleet.wires.crash("ex", Point.BEFORE, in_steps=1, restart_s=120.0)
    fleet.say()
    fleet.until(fleet.ended, 100.0)
    assert fleet.why()[0].kind is Kind.NOT_LOOKED_AROUND


def test_km_away_while_planning(fleet):
    """pl says that km does not answer; the next command is served once it is back."""
    fleet.until(fleet.at_rest)
    fleet.wires.crash("km", Point.BEFORE, in_steps=1, restart_s=50.0)
    fleet.say()
    fleet.until(fleet.ended, 100.0)
    assert fleet.why() == (fact(Kind.NOT_ANSWERED, "km"),)
    fleet.wires.run_for(60.0)
    fleet.say()
    assert fleet.finish(2)[-1] == "done"


def test_km_away_at_the_barrier(fleet):
    """ta reports after a while, and says that observations are pending; km gets them when it is
    back.
    """
    fleet.say()

    def looks():
        act = fleet.wires.memory("ex").act
        return "Look" in str(type(getattr(act, "command", ""))) and seen(fleet)

    fleet.until(looks)
    fleet.wires.crash("km", Point.BEFORE, in_steps=1, restart_s=300.0)
    fleet.until(fleet.ended, 200.0)
    assert fact(Kind.NOT_OBSERVED_YET) in fleet.why()
    fleet.until(fleet.at_rest, 400.0)


def seen(fleet):
    """The first plan has begun."""
    return fleet.wires.memory("ta").plan is not None


def test_ex_away_in_an_act(fleet):
    """The command ends when its time is over; when ex is back the fleet comes to rest and serves
    on.
    """
    fleet.say()
    fleet.until(lambda: seen(fleet) and fleet.state("ex") == "acting")
    fleet.wires.crash("ex", Point.BEFORE, in_steps=1, restart_s=600.0)
    fleet.until(fleet.ended, 500.0)
    assert fleet.why() == (fact(Kind.NOT_ANSWERED, "ta"),)
    fleet.until(fleet.at_rest, 900.0)
    fleet.say()
    assert fleet.finish(2)[-1] == "done"


def test_hypotheses_lost(fleet):
    """km forgets them with its life: the search begins again and asks everything again."""
    fleet.say()
    fleet.until(lambda: any(isinstance(query, wm.HypotheticalState) for query in fleet.asked))
    fleet.wires.crash("km", Point.AFTER, in_steps=1)
    assert fleet.finish() == ["done"]
    made = (query for query in fleet.asked if isinstance(query, wm.HypotheticalState))
    first = [query for query in made if query.id.endswith("plan1/0")]
    assert len(first) == 2


class Dying(Script):
    """A search whose process ends at its first query."""

    def tell(self, content):
        """Die at once."""
        if isinstance(content, Begin | Answer):
            self._post(Died("MemoryError: too large"))


def test_the_search_dies():
    """The command fails in words, and pl waits for the next one."""
    with Fleet(search=lambda post: Dying(post, [])) as fleet:
        fleet.say()
        assert fleet.finish() == ["failed"]
        assert fleet.why() == (fact(Kind.ENDED, "search"),)
