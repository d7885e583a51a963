"""Contents of one look into a container: its run folder and /proc on one sheet, written by a few lines of shell.

A Python started in each container would cost more than all that it looks at.
"""

import msgspec

from agent_runtime.io.run_files import RUN_FOLDER_VARIABLE, STOP_FILE
from operate.cli.fleet import process_status
from operate.run_folder import FLEET_FILE, Fleet

MARK = "@@"
SHEET = f"""cd "${RUN_FOLDER_VARIABLE}" || exit
echo "{MARK} now $(date +%s.%N)"
echo "{MARK} began $(stat -c %.Y /dev)"
for file in *.heartbeat.json *.ready {FLEET_FILE} {STOP_FILE}; do
  when=$(stat -c %.Y "$file" 2>/dev/null) && echo "{MARK} $file $when" && cat "$file" && echo
done
echo "{MARK} stat 0"
cat /proc/[0-9]*/stat 2>/dev/null
true"""


class Sheet(msgspec.Struct, frozen=True):
    """`files`: by name, with the time of their last change; `now`, `began`: the container's clock, and its start."""

    now: float = 0.0
    began: float = 0.0
    files: dict[str, tuple[float, bytes]] = {}
    stats: dict[int, process_status.Stat] = {}

    @property
    def fleet(self) -> Fleet | None:
        """The fleet as reported by a supervisor in the container."""
        try:
            return msgspec.json.decode(self.files[FLEET_FILE][1], type=Fleet)
        except (KeyError, msgspec.DecodeError):
            return None

    @property
    def stop_held(self) -> bool:
        return self.files.get(STOP_FILE, (0.0, b""))[1][:1] == b"\x01"

    def ready(self, name: str) -> bool:
        """Whether a process said that it can serve since the container started."""
        return self.files.get(f"{name}.ready", (0.0, b""))[0] >= self.began > 0

    def beat(self, name: str) -> tuple[process_status.Beat | None, float | None]:
        """A heartbeat and its age [s]."""
        changed, data = self.files.get(f"{name}.heartbeat.json", (0.0, b""))
        return (process_status.beat(data), max(0.0, self.now - changed)) if data else (None, None)

    def pid(self, name: str) -> int:
        """The process of a container that has one: as its heartbeat says, else the child of the first process."""
        beat, _ = self.beat(name)
        if beat is not None and beat.pid in self.stats:
            return beat.pid
        return min((stat.pid for stat in self.stats.values() if stat.parent == 1), default=0)


def sheet(data: bytes) -> Sheet:
    """Read what the script wrote."""
    times: dict[str, float] = {}
    texts: dict[str, list[bytes]] = {}
    name = ""
    for line in data.split(b"\n"):
        if line.startswith(MARK.encode() + b" "):
            _, name, when = line.decode().split(" ")
            times[name], texts[name] = float(when), []
        elif name:
            texts[name].append(line)
    stats = process_status.stats(line.decode(errors="replace") for line in texts.pop("stat", []))
    now, began = times.get("now", 0.0), times.get("began", 0.0)
    kept = texts.keys() - {"now", "began"}
    files = {name: (times[name], b"\n".join(texts[name])) for name in kept}
    return Sheet(now, began, files, stats)
