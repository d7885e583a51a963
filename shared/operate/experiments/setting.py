"""The folder of an experiment: what it repeats (experiment.json), and where its results are."""

import msgspec

SETTING_FILE = "experiment.json"
RESULTS_FILE = "results.jsonl"


class ExperimentSetting(msgspec.Struct, frozen=True):
    """experiment.json: what is repeated, with which seeds, and where. `timeout_s`: wall time of one
    run; `most_load`: a run waits until the machine's load is not above it, 0: it does not. A file
    of another version may lack a field.
    """

    task: str = ""
    runs: int = 0
    seed: int = 0
    speed: str = ""
    scene: str = ""
    timeout_s: float = 0.0
    most_load: float = 0.0
    began: float = 0.0
    version: str = ""
    commit: str = ""
    machine: str = ""
    cores: int = 0
    python: str = ""
