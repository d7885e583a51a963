"""The verbs of `roco` that only this robot has: rows beside those of console.verbs."""

from console.verbs import Table

ROOM = "companion.tools.verbs"
VERBS: Table = {
    "The fleet": {
        "demo": (
            f"{ROOM}.pour_run:demo",
            "Run the main job from start to end, watched: up, say, report, down.",
        )
    },
    "The robot": {
        "say": (
            f"{ROOM}.talk:say",
            'Say a sentence to the robot, such as "pour the jar into the bowl".',
        ),
        "cancel": (
            f"{ROOM}.talk:cancel",
            "Cancel a task: what is held is put down safely, then the next command is served.",
        ),
        "stop": (f"{ROOM}.talk:stop", "Stop the robot at once."),
        "release": (f"{ROOM}.talk:release", "Let the robot move again after `roco stop`."),
        "step": (f"{ROOM}.talk:step", "Let the act that waits for you begin, and no other one."),
        "page": (
            f"{ROOM}.hi:page",
            "Pair a browser with the person's page: print an address that does it once.",
        ),
        "ask": (f"{ROOM}.ask:ask", "Ask what the robot knows, in SPARQL."),
        "urdf": (f"{ROOM}.urdf:urdf", "Write the robot's model as URDF, for other tools."),
    },
    "Faults, on purpose": {
        "fault sensor": (f"{ROOM}.fault:sensor", "Let a sense of the simulated robot fail."),
        "fault thing": (
            f"{ROOM}.fault:thing",
            "Push, tip, remove, add, pull or knock a thing of the simulated world.",
        ),
    },
    "Runs": {
        "experiment pour": (
            f"{ROOM}.pour_run:pour",
            (
                "Repeat the main job, a fresh fleet each time; report.html, .json and .md set it"
                " beside the paper."
            ),
        )
    },
}
