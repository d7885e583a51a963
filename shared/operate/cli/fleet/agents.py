"""`roco agents`: every process of the fleet in a line, all that is known of one, or what the agents
offer.
"""

import time
from functools import partial
from typing import Annotated

import msgspec
import typer

from operate.cli import completion
from operate.cli.errors import NO, NoRunError
from operate.cli.fleet import targets
from operate.cli.fleet.process_status import Info, Row, rows
from operate.cli.fleet.targets import LOG_LINES, Target, named
from operate.cli.output import Form, Format, RunDir, argument, option, problems, tell

BETWEEN_S = 0.5
"""Between the two looks whose difference is the share of a processor: 50 ticks of the kernel's
clock.
"""


class Agents(msgspec.Struct, frozen=True):
    """`roco agents --format json`."""

    where: str
    agents: tuple[Row, ...]


def agents(
    names: Annotated[
        list[str] | None,
        argument("All that is known of these.", complete=targets.processes, metavar="[NAME]..."),
    ] = None,
    offers: Annotated[
        bool, option("What they offer and ask, as the design says.", "--offers")
    ] = False,
    protocol: Annotated[
        str,
        option("Who offers this protocol, or use of one.", complete=completion.protocols_and_uses),
    ] = "",
    ontology: Annotated[
        str, option("Offers of this ontology.", complete=completion.ontologies)
    ] = "",
    language: Annotated[
        str, option("Offers in this language.", complete=completion.languages)
    ] = "",
    up: Annotated[bool, option("Offers of agents that are up.", "--up")] = False,
    long: Annotated[
        bool, option("Offers with arguments and answers of each act.", "--long")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Show every process: state, heartbeat's age, processor, memory, pid, life, restarts,
    communicates that wait.

    Exits with 1 where something is wrong with one, with 3 where nothing runs. `life` is the agent's
    incarnation, `again` how often it was restarted, `waits` how many communicates are not receipted
    or not said yet.

    With NAME: all that is known of a process: its row, its peers, what waits, what it counts, its
    last lines; of an agent also its parameters, its inbox, its open conversations and its last
    steps.

    With --offers: who offers which protocol, ontology, language and query kinds, and who is up.
    What is offered stands in the design, as the participant of a protocol; without a fleet that is
    all there is to tell. Exits with 1 where nobody fits.

    Examples:
      roco agents
      roco agents --target compose
      roco agents AGENT
      roco agents router --format json
      roco agents --offers
      roco agents AGENT --offers --long
      roco agents --protocol request --up --format json
    """
    with problems(form):
        if offers or protocol or ontology or language or up or long:
            from operate.cli.fleet.offers import Search, offered  # most calls ask for processes

            search = Search(tuple(names or ()), protocol, ontology, language)
            offered(search, target, run_dir, form, up=up, long=long)
            return
        fleet = targets.find(target, run_dir)
        if names:
            for told in info(fleet, names):
                tell(told, form, partial(_show, told))
            return
        found = measured(fleet)
        tell(Agents(fleet.where, found), form, partial(_show, found))
        if not any(row.pid for row in found):
            nothing = f"nothing of {fleet.where} runs; `roco up` starts a fleet"
            raise NoRunError(fleet.where, nothing)
        if any(row.trouble for row in found):
            raise typer.Exit(NO)


def _show(found: Info | tuple[Row, ...]) -> None:
    from operate.cli.fleet import process_tables  # a program that reads JSON needs no rich

    if isinstance(found, Info):
        process_tables.show_info(found)
    else:
        process_tables.show_agents(found)


def info(fleet: Target, names: list[str]) -> list[Info]:
    """All that is known of these processes. UsageError where one is not there."""
    beats = {name: named(fleet, name).beat for name in names}
    by_name, design = {row.name: row for row in measured(fleet)}, fleet.system.design
    found = []
    for name, beat in beats.items():
        peers = dict(design.peers(name)) if name in design.agents else {}
        found.append(Info(fleet.where, by_name[name], beat, peers, fleet.log(name, LOG_LINES)))
    return found


def measured(fleet: Target, between_s: float = BETWEEN_S) -> tuple[Row, ...]:
    """Two looks a moment apart."""
    before = fleet.look()
    time.sleep(between_s if before.seen else 0.0)
    return rows(before, fleet.look())
