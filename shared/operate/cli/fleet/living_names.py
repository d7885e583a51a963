"""Names for the shell to complete that only a fleet knows: its processes. Apart from operate.cli.completion, whose
names the options of operate.cli.fleet.targets take: what looks for a fleet stands above those.
"""

from operate.cli import completion
from operate.cli.errors import ConsoleError
from operate.cli.fleet import targets


def processes(incomplete: str) -> list[str]:
    """Return the processes of the fleet that is meant without a word; where none runs, the agents of the design."""
    try:
        found = [one.name for one in targets.find().look().seen]
    except ConsoleError:
        return completion.agents(incomplete)
    return [name for name in found if name.startswith(incomplete)]
