"""The tests of a project: the design is consistent, each agent binds and answers, all of them meet over Zenoh."""

from topdown.model.design import Design
from topdown.scaffold.agents import openings
from topdown.scaffold.naming import imports


def check_files(design: Design, package: str) -> dict[str, str]:
    """Path -> text."""
    files = {"tests/test_design.py": _DESIGN.format(package=package), "tests/test_run.py": _run(package)}
    for agent in design.agents:
        files[f"tests/test_{agent}.py"] = _agent(design, package, agent)
    return files


def _agent(design: Design, package: str, agent: str) -> str:
    asked = list(openings(design, agent))
    own = imports(
        f"from {package}.{agent} import interface",
        f"from {package}.{agent}.behaviours import agent",
        f"from {package}.design import DESIGN, INTERFACES, LANGUAGES",
    )
    text = _ALONE.format(package=package, agent=agent, pytest="import pytest\n" if asked else "", own=own)
    if not asked:
        return text.replace("from agent_runtime.testing.samples import sample_named\n", "").replace(_UNUSED, "")
    rows = "\n".join(f'    ("{peer}", "{protocol}", P("{act}"), "{name}"),' for peer, protocol, act, name in asked)
    return text.replace("\n\n\ndef alone", f"\n\nASKED = [\n{rows}\n]\n\n\ndef alone") + _ASKED


_UNUSED = "from fipa_codec.performatives import Performative as P\n"

_DESIGN = '''"""The design is consistent in itself, and agrees with the languages and the protocols it names."""

from topdown import check
from topdown.check import agreement

from {package}.design import DESIGN, LANGUAGES


def test_the_design_is_consistent():
    """No finding; each would say what is wrong and what would be right."""
    assert check.check(DESIGN) == ()


def test_the_languages_have_the_designs_classes():
    """Every class that the design names is there, and every language."""
    names = [entry.name for entry in DESIGN.file.language]
    classes = {{name: [kind.__name__ for kind in LANGUAGES.named(name).classes] for name in names}}
    assert agreement.check_languages(DESIGN, classes) == ()
'''

_ALONE = '''"""a_{agent} alone: it is what the design says, and whatever it may be asked is answered."""

{pytest}from agent_runtime.core.binding import wiring
from agent_runtime.testing.alone import Alone
from agent_runtime.testing.samples import sample_named
from fipa_codec.performatives import Performative as P

{own}


def alone() -> Alone:
    """The agent, started, with all its peers there."""
    return Alone(agent(), wiring("{agent}", "test", design=DESIGN, languages=LANGUAGES))


def test_it_is_bound_to_the_design():
    """Every behaviour and condition of the design has its function, and no other; it starts where the design says."""
    made = agent()
    entry = DESIGN.agent("{agent}")
    assert made.start == entry.initial
    assert set(made.behaviours) == {{state.name for state in entry.state}}


def test_its_interface_is_the_designs():
    """The typed interface says what the design says."""
    for use, info in (interface.OFFERS | interface.ASKS).items():
        assert list(info) == list(INTERFACES[use])
'''

_ASKED = '''

@pytest.mark.parametrize(("peer", "protocol", "act", "content"), ASKED)
def test_whatever_it_is_asked_is_answered(peer, protocol, act, content):
    """A sample of each question gets a word within a minute, or waits where the design's rows do not take it yet."""
    one = alone()
    name = one.ask(peer, protocol, act, sample_named(LANGUAGES, content), reply_by=one.now + 60.0)
    one.wait(60.0)
    assert one.answers(name) or one.waiting
'''


def _run(package: str) -> str:
    return f'''"""All processes over a real Zenoh router: every agent hears an answer on each of its channels."""

import subprocess
import sys
from pathlib import Path


def test_all_become_ready(tmp_path):
    """`python -m {package} --until-ready` ends with 0 once router and agents are ready."""
    command = [sys.executable, "-m", "{package}", "--until-ready", "--run-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
'''
