"""All verbs of `roco` in one table: the words that call it, where its function is, what it does in a line.

A verb is a plain function with typer's annotations; what it prints it prints in both forms (services.console.forms).
Nothing is imported before it is called (services.console.lazy): the line below is what `roco --help` shows, and the
function's docstring begins with the same words. A docstring ends in `Examples:` with one call of roco a line.
"""

GROUP = ""
"""In place of a function: the row only says what the verbs below it have in common."""

VERBS: dict[str, dict[str, tuple[str, str]]] = {
    "The fleet": {
        "up": ("up:up", "Bring the fleet up in the background."),
        "down": ("up:down", "Bring the fleet down in order; works with a dead supervisor, too."),
        "status": ("status:status", "Show the fleet's processes and the tasks."),
        "agents": ("agents:agents", "Show every process: state, heartbeat's age, processor, memory."),
        "agent": (GROUP, "One process of the fleet."),
        "agent info": ("agent:info", "Show all that is known of a process."),
        "agent restart": ("agent:restart", "Restart a process, and wait until it is ready."),
        "agent stop": ("agent:stop", "Stop a process in order; it stays down until `roco agent start`."),
        "agent start": ("agent:start", "Start a process that was stopped or given up, and wait until it is ready."),
        "view": ("view:view", "Look at a running fleet or at a recorded run in Rerun."),
        "graph": ("graph:graph", "Draw agents and channels with their states and what goes over each channel now."),
        "top": ("top:top", "Show agents, channels, the task and the plan's present state on a live screen."),
        "doctor": ("doctor:doctor", "Check machine, installation and fleet: what is wrong, why, and what to do."),
        "demo": ("up:demo", "Run the main job from start to end, watched: up, say, report, down."),
    },
    "The robot": {
        "say": ("talk:say", 'Say a sentence to the robot, such as "pour the jar into the bowl".'),
        "cancel": ("talk:cancel", "Cancel a task: what is held is put down safely, then the next command is served."),
        "stop": ("talk:stop", "Stop the robot at once."),
        "release": ("talk:release", "Let the robot move again after `roco stop`."),
    },
    "What is said": {
        "traffic": (GROUP, "The traffic of a run."),
        "traffic echo": ("traffic_echo:echo", "Print a line for each communicate."),
        "traffic hz": ("traffic_rates:hz", "Show how often each act is said on each channel."),
        "traffic bw": ("traffic_rates:bw", "Show how many bytes per second each channel carries."),
        "traffic size": ("traffic_rates:size", "Show how large communicates are."),
        "traffic stats": ("traffic_rates:stats", "Show counts, sizes, rates, and how long answers took."),
        "record": ("record:record", "Record the traffic of a running fleet from now until Ctrl-C, as an MCAP file."),
        "replay": ("replay:replay", "Say again what a recording holds, with its timing, where no robot hears it."),
        "traffic judge": ("traffic:judge", "Judge every communicate of a recording by the design."),
        "conversation": (GROUP, "The conversations of a run."),
        "conversation list": ("conversation:list_", "List conversations, oldest first."),
        "conversation show": ("conversation:show", "Show a conversation as a sequence diagram."),
        "send": ("send:send", "Be an agent: say one communicate to the running fleet, and print what comes back."),
        "acl": (GROUP, "Messages of other FIPA platforms, in their text (SC00070I)."),
        "acl show": ("acl:show", "Show what a message says."),
    },
    "Runs reported, repeated, compared": {
        "report": ("report:report", "Make the report of a run again from its recording, and show it."),
        "export": (
            "export:export",
            "Write what a recording holds as tables: communicates, events, telemetry of the loop.",
        ),
        "compare": ("compare:compare", "Compare two sets of runs: success, latency, energy, traffic."),
        "experiment": (GROUP, "The main job repeated, and what it comes to."),
        "experiment pour": (
            "experiment:pour",
            "Repeat the main job, a fresh fleet each time; report.html, .json and .md set it beside the paper.",
        ),
    },
    "The design": {
        "design": (GROUP, "The design: checked, shown, proven."),
        "design check": (
            "design_check:check",
            "Check a design: steps, channels, messages both ways, interfaces.",
        ),
        "design diff": (
            "design_diff:diff_",
            "Tell what changed between two designs.",
        ),
        "design estimate": ("design_estimate:estimate_", "Estimate counts, sizes, bandwidth, latencies, bottlenecks."),
        "design export": (
            "design_export:export",
            "Write the models of a design's protocols for spin (Promela).",
        ),
        "design follow": ("design_follow:follow", "Follow a run through the composed model of its design."),
        "design new": (
            "design_new:new",
            "Make a project of a design: packages, typed interfaces, stubs.",
        ),
        "design show": (
            "design_show:show",
            "Show a design: requirements, steps, channels, protocols, the system.",
        ),
        "design trace": ("design_trace:trace_", "Trace every leaf requirement to what shows that it is met."),
        "design verify": (
            "design_verify:verify",
            "Prove a design: no deadlock, nothing unforeseen.",
        ),
        "keys": (GROUP, "Certificates of a fleet, and the router's rules."),
        "keys make": ("keys:make", "Make an authority, a certificate per identity and the router's rules, all anew."),
    },
}
