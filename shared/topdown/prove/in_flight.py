"""Words on their way outside the durable streams: questions, answers, subscriptions, the newest observations.

A volatile channel is a set of words: copies of one word are one, and what belongs to a question that was given up is
dropped at once, as the receiver would. All operations are pure.
"""

from typing import NamedTuple

from topdown.model.machines import Said


class Net(NamedTuple):
    """`words` on the way. `current`: the participant's conversation is the initiator's present one. `stale`: there is
    news the initiator does not have, as far as the participant was told.
    """

    words: frozenset[Said] = frozenset()
    current: bool = False
    stale: bool = False

    def opened(self, said: Said) -> "Net":
        """The initiator asks, perhaps again: every other word on the way belongs to an older question."""
        return Net(frozenset({said}), False, self.stale)

    def closed(self) -> "Net":
        """The initiator has its answer, gave up, or died: nobody waits for what is on the way."""
        return Net(frozenset(), False, self.stale)

    def orphaned(self) -> "Net":
        """The participant's conversation is over, or gone with its death; what it said is still on the way."""
        return self._replace(current=False)

    def added(self, said: Said) -> "Net":
        """One more word."""
        return self._replace(words=self.words | {said})

    def answered(self, said: Said) -> "Net":
        """The participant says something; in a conversation that nobody holds any more it is lost."""
        return self.added(said) if self.current else self

    def owed(self, news: Said) -> "Net":
        """Something new was observed: it is sent where somebody listens; older news are worth nothing."""
        return Net(self.words | {news} if self.current else self.words - {news}, self.current, True)

    def known(self, news: Said) -> "Net":
        """The newest observation was taken, and its receipt came."""
        return Net(self.words - {news}, self.current, False)

    def taken(self, said: Said, *, copy: bool = False) -> "Net":
        """A word was taken; of a copied one another is still on the way."""
        return self if copy else self._replace(words=self.words - {said})

    def accepted(self) -> "Net":
        """The participant took the opening: its conversation is the present one."""
        return self._replace(current=True)
