"""Names of the files in a run folder; docs/run-folder.md says who writes which."""

LATEST = "latest"  # runs/latest: symbolic link to the newest run folder
FLEET_FILE = "fleet.json"
# held (flock) by the supervisor as long as it lives, with its pid in it
LOCK_FILE = "supervisor.lock"
LIVE_FILE = "live.jsonl"
VERDICTS_FILE = "verdicts.jsonl"
TRAFFIC_FILE = "traffic.mcap"
STEPS = "steps"  # folder of the agents' step logs, and the ending of their names
REPORT_FILE = "report.json"
RRD_FILE = "run.rrd"
VIEW_FILE = "view.json"
FAULTS_FILE = "faults.jsonl"
# <name>.off: the supervisor keeps this process down as long as the file is there
OFF_SUFFIX = ".off"
