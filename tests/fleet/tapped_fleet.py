"""A judge that taps the pretended wires: it hears what is sent, when it is sent, and who is born."""

from typing import Any

from agent_runtime.testing.memory_bus import MemoryBus
from companion.all_languages import LANGUAGES
from companion.design import DESIGN
from fipa_codec.communicate import Communicate, encode
from topdown.judge.judge import Judge
from topdown.judge.verdicts import Judgement


class Tapped(list[Communicate]):
    """The traffic of some wires, and what a judge says about it: `judgements`, once `finished`."""

    def __init__(self, wires: MemoryBus) -> None:
        super().__init__(wires.traffic)
        self._wires = wires
        self.judge = Judge(DESIGN, LANGUAGES)
        self.judgements: list[Judgement] = []
        self._lives: dict[str, int] = {}
        wires.traffic = self
        wires.on_step = self._stepped

    def append(self, communicate: Communicate) -> None:
        """It is sent, and heard at once."""
        super().append(communicate)
        key = DESIGN.key("test", communicate)
        self.judgements += self.judge.hear(key, encode(communicate), self._wires.now)

    def finished(self) -> list[Judgement]:
        """All judgements, the fleet having stopped."""
        self.judgements += self.judge.finish(self._wires.now)
        return self.judgements

    def violations(self) -> list[str]:
        """All that is against the design, in words."""
        return [f"{one.verdict}: {one.heard.communicate} {one.why}" for one in self.finished() if one.violation]

    def _stepped(self, agent: str, effects: Any) -> None:
        state = self._wires.nodes[agent].state
        if state is not None and self._lives.get(agent) != state.incarnation:
            self._lives[agent] = state.incarnation
            self.judgements += self.judge.lived(agent, state.incarnation, self._wires.now, fresh=True)
