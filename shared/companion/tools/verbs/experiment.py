"""`roco experiment pour`: the main job repeated, each run with a fresh fleet; the figures beside the paper's."""

from operate.cli.fleet.up import Rate, SceneFile, Speed
from operate.cli.output import FirstSeed, Form, Format
from operate.cli.runs.experiment import Count, MostLoad, Place, Resume, Timeout, repeated
from operate.cli.runs.trials import Asked


def pour(
    runs: Count = 30,
    seed: FirstSeed = 1,
    speed: Rate = Speed.MAX,
    scene: SceneFile = None,
    out: Place = None,
    resume: Resume = False,
    timeout: Timeout = 360.0,
    most_load: MostLoad = 0.0,
    form: Form = Format.TEXT,
) -> None:
    """Repeat the main job, a fresh fleet each time; report.html, .json and .md set it beside the paper.

    Exits with 0 when all runs are done, whether they poured or not; interrupted, it goes on with --resume.

    Examples:
      roco experiment pour --runs 30 --seed 1
      roco experiment pour --runs 30 --out experiments/mine --resume
    """
    asked = Asked(runs, seed, speed.value, scene, timeout, most_load)
    repeated(("pour",), ("demo", "--headless"), asked, out, resume, form, "poured")
