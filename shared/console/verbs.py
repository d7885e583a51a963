"""The verbs of `roco` that serve any system, in one table: words that call it, where its function
is, what it does.

A verb is a plain function with typer's annotations; what it prints it prints in both forms
(console.output). Other verbs may begin with its words (`record`, `record info`). Nothing is
imported before it is called (console.lazy): the line below is what `roco --help` shows, and the
function's docstring begins with the same words. A docstring ends in `Examples:` with one call of
roco a line.

A system adds rows of its own (operate.system.Additions), of the same form; a place without a dot
before it is absolute.
"""

GROUP = ""
"""In place of a function: the row only says what the verbs below it have in common."""

Table = dict[str, dict[str, tuple[str, str]]]
VERBS: Table = {
    "The fleet": {
        "up": (".fleet.up:up", "Bring the fleet up in the background."),
        "down": (
            ".fleet.up:down",
            "Bring the fleet down in order; works with a dead supervisor, too.",
        ),
        "status": (".fleet.status:status", "Show the fleet's processes and the tasks."),
        "agents": (
            ".fleet.agents:agents",
            "Show every process: state, heartbeat's age, processor, memory.",
        ),
        "agent": (GROUP, "One process of the fleet."),
        "agent restart": (
            ".fleet.agents:restart",
            "Restart a process, and wait until it is ready.",
        ),
        "agent stop": (
            ".fleet.agents:stop",
            "Stop a process in order; it stays down until `roco agent start`.",
        ),
        "agent start": (
            ".fleet.agents:start",
            "Start a process that was stopped or given up, and wait until it is ready; let a"
            " paused agent go on.",
        ),
        "agent repair": (
            ".fleet.agents:repair",
            "Repair the damaged journal of an agent that does not run.",
        ),
        "agent pause": (
            ".fleet.agents:pause",
            "Let an agent take no step until `roco agent start`.",
        ),
        "param": (
            ".fleet.param:param",
            "Show the parameters of all agents, of one, or a single one; with VALUE set it"
            " while the agent runs.",
        ),
        "logs": (
            ".fleet.logs:logs",
            "Show the logs of all agents as one stream, in the order of time.",
        ),
        "view": (".fleet.view:view", "Look at a running fleet or at a recorded run in Rerun."),
        "top": (
            ".terminal.top:top",
            "Show agents, channels, the task and the state of its plan on a live screen.",
        ),
        "mcp": (
            ".fleet.assistants:mcp",
            "Offer a running fleet's tools to an assistant that speaks MCP.",
        ),
        "a2a": (
            ".fleet.other_agents:a2a",
            "Offer a running fleet's skills to other agents that speak A2A.",
        ),
        "fipa": (
            ".fleet.platforms:fipa",
            "Let agents of other FIPA platforms, such as JADE, talk with a running fleet.",
        ),
        "doctor": (
            ".fleet.checkup:doctor",
            "Check machine, installation and fleet: what is wrong, why, and what to do.",
        ),
    },
    "Traffic": {
        "traffic": (GROUP, "The traffic of a run."),
        "traffic echo": (".traffic.echo:echo", "Print a line for each communicate."),
        "traffic stats": (
            ".traffic.rates:stats",
            "Show counts, sizes, rates, and how long answers took; or more of one of them.",
        ),
        "sniff": (
            ".traffic.echo:sniff",
            "Draw a live sequence diagram of the traffic, with a lifeline for each agent.",
        ),
        "record": (
            ".traffic.record:record",
            "Record the traffic of a running fleet from now until Ctrl-C, as an MCAP file.",
        ),
        "record info": (
            ".traffic.record:info",
            "Show what is in a recording: topics with counts and times, who wrote it.",
        ),
        "record repair": (
            ".traffic.record:repair",
            "Write a recording again in chunks with an index.",
        ),
        "replay": (
            ".traffic.replay:replay",
            "Replay a recording, with its timing, on a private router that no robot listens to.",
        ),
        "traffic judge": (
            ".traffic.judge:judge",
            "Judge every communicate of a recording by the design.",
        ),
        "traffic dead": (
            ".traffic.judge:dead_",
            "List the communicates that nobody took, and why.",
        ),
        "conversation": (
            ".traffic.trace:conversation",
            "List the conversations of a run, oldest first; show one as a sequence diagram.",
        ),
        "trace": (
            ".traffic.trace:trace",
            "Show which communicate of a task caused which, across all agents, as a tree with"
            " times.",
        ),
        "why": (".traffic.trace:why", "Tell why a task went as it did, from what is recorded."),
        "send": (
            ".traffic.send:send",
            "Send one communicate as an agent, and print the replies.",
        ),
        "acl": (GROUP, "Messages of other FIPA platforms, in their text (SC00070I)."),
        "acl show": (".traffic.acl:show", "Show what a message says."),
    },
    "Faults, on purpose": {
        "fault": (
            ".faults.verbs:fault",
            "Do a fault to a process of a running fleet, record it, and heal it at its end.",
        ),
        "fault run": (
            ".faults.verbs:run",
            "Do the faults of a scenario, and wait until all are over.",
        ),
        "fault list": (".faults.verbs:list_", "List the faults of a run."),
        "fault heal": (".faults.verbs:heal", "Heal all faults that go on."),
        "chaos": (
            ".faults.chaos:chaos",
            "Do the system's job again and again, each time with a fault that a seed chooses,"
            " and judge each whole history.",
        ),
    },
    "Runs": {
        "runs": (
            ".runs.catalogue:runs",
            "List the runs that were kept: begin, duration, size on disk, system, result.",
        ),
        "report": (
            ".runs.report:report",
            "Make the report of a run again from its recording, and show it.",
        ),
        "export": (
            ".runs.report:export",
            "Write what a recording holds for other tools: tables, or a rosbag2 of ROS 2.",
        ),
        "compare": (
            ".runs.report:compare",
            "Compare two sets of runs: success, latency, energy, traffic.",
        ),
        "experiment": (GROUP, "Repeat runs, and see how they differ."),
        "experiment run": (
            ".runs.experiment:run",
            "Repeat runs of a fresh fleet, and write report.html, .json and .md.",
        ),
    },
    "The design": {
        "design": (GROUP, "The design: checked, shown, proven."),
        "design asyncapi": (
            ".design.asyncapi:asyncapi",
            "Write the messages of a design as an AsyncAPI 3.0 document (JSON).",
        ),
        "design check": (
            ".design.check:check",
            "Check a design: steps, channels, messages both ways, interfaces.",
        ),
        "design diff": (".design.check:diff_", "Tell what changed between two designs."),
        "design export": (
            ".design.verify:export",
            "Write the models of a design's protocols for spin (Promela).",
        ),
        "design follow": (
            ".design.verify:follow",
            "Follow a run through the composed model of its design.",
        ),
        "design new": (
            ".design.new:new",
            "Make a project of a design: packages, typed interfaces, stubs.",
        ),
        "design show": (
            ".design.show:show",
            "Show a design: requirements, steps, channels, protocols, the system.",
        ),
        "design trace": (
            ".design.check:trace_",
            "Trace every leaf requirement to what shows that it is met.",
        ),
        "design verify": (
            ".design.verify:verify",
            "Prove a design: no deadlock, nothing unforeseen.",
        ),
        "protocol": (
            ".design.show:protocol",
            "List the protocols that a design can follow; show the tables of one: who may say"
            " what in which state.",
        ),
        "keys": (GROUP, "Certificates of a fleet, and the router's rules."),
        "keys make": (
            ".fleet.keys:make",
            "Make an authority, a certificate per identity and the rules of router and agents,"
            " all anew.",
        ),
        "keys revoke": (
            ".fleet.keys:revoke",
            "Deny everything to whoever has the key of a name: the router listens again within"
            " a second.",
        ),
    },
}


def merged(general: Table, own: Table) -> Table:
    """Return both tables: rows of a panel that both have side by side, an own panel behind the own
    panel before it.
    """
    order, after = list(general), len(general)
    for panel in own:
        if panel not in order:
            order.insert(after, panel)
        after = order.index(panel) + 1
    return {panel: general.get(panel, {}) | own.get(panel, {}) for panel in order}
