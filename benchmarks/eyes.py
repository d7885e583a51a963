"""Eyes by pixels against the truth: how often each thing is seen, and how far off.

Scenes are varied by seeds; in every second canonical one the bowl stands on table_1, and the torso
is turned. The head looks at each thing, off by up to 4 cm. Appends a line per scene, seed and
setting; --page makes the table of all.

    python benchmarks/eyes.py --seeds 1-30
    python benchmarks/eyes.py --seeds 1-30 --blur 1
    python benchmarks/eyes.py --scene env2 --seeds 1-30
    python benchmarks/eyes.py --page docs/results/eyes.md --picture docs/images/head-camera.png
"""

import math
import time
from pathlib import Path
from typing import Annotated, Any

import cv2
import msgspec
import mujoco
import numpy as np
import tables
import typer

from companion.skills.motions import aim
from velma import names
from velma.eyes.fit import View
from velma.eyes.lens import LENS
from velma.eyes.seeing import eyes_of
from velma.kinematics.robot import Robot
from velma.model.kinds import TABLES, objects
from velma.model.scene import CANONICAL, Scene, SceneObject, load, vary
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.photographs import Photographs

RESULTS = Path(__file__).parent / "results" / "eyes.jsonl"
BEGIN, END = "<!-- eyes: made by benchmarks/eyes.py -->\n", "<!-- end of eyes -->"
JITTER_M, TORSOS = 0.04, (0.0, 0.3, 0.0, -0.3)
PICTURED, GREEN = (0.95, 0.31, 1.05), (120, 220, 64)  # [m] where the head looks; blue, green, red
BOWL_ON_TABLE = (0.82, -0.56, 0.775)  # [m] where the task puts it
DISTANCES = ((0.0, 0.8), (0.8, 1.1), (1.1, 1.5), (1.5, 3.0))  # [m] from the camera
COVERED = 7.815  # chi squared of three unknowns, 95 %
TRIAL = {"jar": (0.3, 2.1), "bowl": (0.0, 0.1), "cabinet": (0.0, 1.9), "table": (0.0, 0.1)}
"""Horizontal error [mm], median and 95 %, of a trial of the head's views on 2026-11-25 with these
markers.
"""


def measured(scene: Scene, seed: int) -> dict[str, Any]:
    """One seed, as a line of the results file."""
    backend, robot, eyes, camera = MujocoBackend(scene), Robot(), eyes_of(scene), Photographs(scene)
    model, qpos, rng = backend.model, backend.configuration().copy(), np.random.default_rng(seed)
    data, torso = mujoco.MjData(model), TORSOS[seed % len(TORSOS)]
    if seed % 2 == 0 and scene.name.startswith("canonical"):
        start = model.jnt_qposadr[model.body("bowl_1").jntadr[0]]
        qpos[start : start + 3] = BOWL_ON_TABLE
    lines: list[dict[str, Any]] = []
    cpu = 0.0
    for number, thing in enumerate(scene.things):
        target = (
            _true(model, data, qpos, thing.id)[1]
            + rng.uniform(-JITTER_M, JITTER_M, 3)
            + _middle(thing)
        )
        goal = aim(torso, target)
        for joint, angle in zip(
            (names.BODY[0], *names.HEAD), (torso, goal.pan, goal.tilt), strict=True
        ):
            qpos[model.joint(joint).qposadr[0]] = angle
        eye = robot.camera(torso, goal.pan, goal.tilt)
        began = time.process_time()
        found = eyes.markers(camera.take(qpos, number))
        seen = {
            one.name: one for one in eyes.bodies(found, View(LENS, eye.rotation, eye.translation))
        }
        cpu += time.process_time() - began
        for other in scene.things:
            rotation, position = _true(model, data, qpos, other.id)
            away = round(float(np.linalg.norm(position + _middle(other) - eye.translation)), 3)
            if other.id in seen:
                lines.append(
                    _line(seen[other.id], rotation, position)
                    | {
                        "looked_at": other is thing,
                        "away_m": away,
                    }
                )
            elif other is thing:
                lines.append({"thing": thing.id, "seen": False, "looked_at": True, "away_m": away})
    camera.close()
    return {"cpu_ms": round(1e3 * cpu / len(scene.things), 1), "sights": lines}


def _middle(thing: SceneObject) -> np.ndarray:
    """Where one looks for a thing, from its origin: a table's is on the floor."""
    return np.array(
        objects()[thing.model]["parts"]["top"]["xyz"] if thing.model in TABLES else (0.0, 0.0, 0.0)
    )


def _true(model: Any, data: Any, qpos: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    body = data.body(name)
    return body.xmat.reshape(3, 3).copy(), body.xpos.copy()


def _line(seen: Any, rotation: np.ndarray, position: np.ndarray) -> dict[str, Any]:
    off, turn = seen.position - position, seen.rotation @ rotation.T
    inside = off @ np.linalg.solve(seen.covariance[:3, :3], off) < COVERED
    return {
        "thing": seen.name, "seen": True, "across_mm": round(1e3 * math.hypot(off[0], off[1]), 3),
        "up_mm": round(1e3 * abs(float(off[2])), 3), "markers": len(seen.numbers),
        "covered": bool(inside),
        "yaw_deg": round(abs(math.degrees(math.atan2(turn[1, 0], turn[0, 0]))), 3),
        "tipped": seen.tipped,
    }  # fmt: skip


def draw(scene: Scene, file: Path) -> None:
    """Save what the camera sees of the jar's surroundings, with the markers found and the names of
    what is believed.
    """
    backend, robot, eyes, camera = MujocoBackend(scene), Robot(), eyes_of(scene), Photographs(scene)
    qpos, goal = backend.configuration().copy(), aim(0.0, PICTURED)
    for joint, angle in zip(names.HEAD, (goal.pan, goal.tilt), strict=True):
        qpos[backend.model.joint(joint).qposadr[0]] = angle
    (clean, taken), eye = camera.both(qpos, 0), robot.camera(0.0, goal.pan, goal.tilt)
    found, view = eyes.markers(taken), View(LENS, eye.rotation, eye.translation)
    shown = cv2.cvtColor(clean, cv2.COLOR_RGB2BGR)
    fine = {"shift": 4, "lineType": cv2.LINE_AA}
    cv2.polylines(
        shown, [np.rint(16 * at).astype(np.int32) for at in found.values()], True, GREEN, 2, **fine
    )
    for seen in eyes.bodies(found, view):
        corners = np.concatenate([found[number] for number in seen.numbers])
        _label(
            shown,
            f"{seen.name}: {len(seen.numbers)} markers",
            corners[:, 0].mean(),
            corners[:, 1].min() - 14,
        )
    cv2.imwrite(str(file), shown, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    camera.close()


def _label(picture: np.ndarray, words: str, x: float, y: float) -> None:
    """Write black on white, the middle at x, the lower end at y."""
    (width, height), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    left, low = int(x - width / 2), int(y)
    cv2.rectangle(
        picture,
        (left - 4, low - height - 5),
        (left + width + 4, low + 5),
        (255, 255, 255),
        cv2.FILLED,
    )
    cv2.putText(
        picture, words, (left, low), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (30, 30, 30), 1, cv2.LINE_AA
    )


def table(rows: list[dict[str, Any]]) -> str:
    """Return the tables of a results file: by setting and thing, then by distance."""
    out = []
    for scene, pixel, blur in sorted({(row["scene"], row["pixel"], row["blur"]) for row in rows}):
        some = [
            row for row in rows if (row["scene"], row["pixel"], row["blur"]) == (scene, pixel, blur)
        ]
        cpu = np.median([row["cpu_ms"] for row in some])
        out.append(
            f"\n**{scene}**, noise {pixel:g} grey levels, blur {blur:g} pixels, {len(some)} seeds;"
            f" {cpu:.0f} ms of processor a look.\n\n| thing | distance m | looks at it, seen |"
            " sights | across mm p50 / p95 / most | up mm p50 / p95 | yaw deg p95 | truth in the"
            " 95 % region | trial mm p50 / p95 |\n|---|---|---|---|---|---|---|---|---|"
        )
        sights = [one for row in some for one in row["sights"]]
        for kind in sorted({_kind(one["thing"]) for one in sights}):
            of_kind = [one for one in sights if _kind(one["thing"]) == kind]
            out.append(
                _row(kind, "all", of_kind, TRIAL.get(kind) if pixel == 5 and blur == 0 else None)
            )
            for low, high in DISTANCES:
                here = [one for one in of_kind if low <= one["away_m"] < high]
                if any(one["seen"] for one in here) and len(here) < len(of_kind):
                    out.append(_row("", f"{low:g}-{high:g}", here, None))
    return "\n".join(out) + "\n\n"


def _row(
    kind: str, distance: str, sights: list[dict[str, Any]], trial: tuple[float, float] | None
) -> str:
    at, seen = [one for one in sights if one["looked_at"]], [one for one in sights if one["seen"]]

    def part(field: str, *shares: float) -> str:
        return " / ".join(f"{x:.2f}" for x in np.percentile([one[field] for one in seen], shares))

    found = f"{sum(one['seen'] for one in at)} of {len(at)}" if at else ""
    covered = f"{np.mean([one['covered'] for one in seen]):.2f}"
    compared = f"{trial[0]} / {trial[1]}" if trial else ""
    cells = (
        kind,
        distance,
        found,
        len(seen),
        part("across_mm", 50, 95, 100),
        part("up_mm", 50, 95),
    )
    return f"| {' | '.join(map(str, (*cells, part('yaw_deg', 95), covered, compared)))} |"


def _kind(name: str) -> str:
    return name.rpartition("_")[0]


def _changed(scene: Scene, **noise: float | None) -> Scene:
    told = {name: value for name, value in noise.items() if value is not None}
    return msgspec.structs.replace(scene, noise=msgspec.structs.replace(scene.noise, **told))


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "",
    scene: Annotated[str, typer.Option(help="a scene of velma/model/scenes")] = CANONICAL.stem,
    pixel: Annotated[
        float | None, typer.Option(help="noise in grey levels, else the scene's")
    ] = None,
    blur: Annotated[float | None, typer.Option(help="in pixels, else the scene's")] = None,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    page: Annotated[Path | None, typer.Option(help="put the tables into this page")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="save a picture with what is found in it")
    ] = None,
) -> None:
    """Run the seeds that do not stand in the results file yet; make the tables."""
    rows = tables.read(out)
    for seed in tables.seeds(seeds) if seeds else ():
        varied = _changed(vary(load(CANONICAL.with_stem(scene)), seed), pixel=pixel, blur=blur)
        setting = {
            "scene": scene,
            "seed": seed,
            "pixel": varied.noise.pixel,
            "blur": varied.noise.blur,
        }
        if any(all(row[key] == value for key, value in setting.items()) for row in rows):
            continue
        row = setting | measured(varied, seed)
        rows.append(row)
        tables.append(out, row)
    if picture is not None:
        draw(load(CANONICAL.with_stem(scene)), picture)
    if page is not None:
        tables.put(page, BEGIN, table(rows), END)
    else:
        typer.echo(table(rows))


if __name__ == "__main__":
    typer.run(main)
