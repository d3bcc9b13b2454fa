"""``vlmgineer scene "SENTENCE" [pictures=[a.jpg,b.jpg]] [known={mug.height: 0.095}] vlm=NAME output=FILE.yaml``."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from omegaconf import DictConfig, OmegaConf
from pydantic import TypeAdapter, ValidationError

from core.config.compose import load, part
from core.config.schemas import RunConfig
from core.errors import UsageError, UserError
from core.plugins import ROBOT, SIMULATOR
from core.support.cli import arguments, expand, say, write_bytes
from core.support.files import read_text
from core.support.templates import fill
from core.support.text import clean
from plugins.tasks.file.bench.asking import open_asker
from plugins.tasks.file.bench.bench_page import draw_page
from plugins.tasks.file.bench.board import FAR_M, find_by_board, print_board
from plugins.tasks.file.bench.checks import find_needed
from plugins.tasks.file.bench.drafts import PACKAGE, Draft
from plugins.tasks.file.bench.findings import (
    Verdict,
    describe_fit,
    judge_numbers,
)
from plugins.tasks.file.bench.photographs import read_photographs
from plugins.tasks.file.bench.scene_replies import LONGEST
from plugins.tasks.file.bench.views import CameraError

USAGE = (
    'usage: vlmgineer scene ["SENTENCE"] [FILE.yaml] [pictures=[a.jpg,b.jpg]] [cameras=[{position: [x,y,z], target: '
    "[x,y,z], fov_deg: 52}]] [camera_error={place_m: 0.01, turn_deg: 1, fov_deg: 1}] [board=[x,y,yaw_deg]] "
    "[board_marker_mm=50] [known={mug.height: 0.095, table_corner: [1.35,0.5,0]}] [vlm=NAME] "
    "[tries=3] [output=FILE.yaml], or print_board=board.pdf"
)
_KNOWN = TypeAdapter(dict[str, float | tuple[float, float, float]])
_LONGEST = {
    re.compile(r"(radius|diameter|wall|thickness)$"): 0.5,
    re.compile(r"(height|width|length|depth|size)$"): 2.0,
    re.compile(r"[xyz]$"): FAR_M,
}
"""By what a name ends with: the longest that one measures on a bench, m."""

_SETTING = re.compile(r"-|[+~]?[\w./@]+=")


@dataclass
class SceneFileConfig(RunConfig):
    """Settings of ``vlmgineer scene``, beside ``known``: numbers by what they are of, and places (three) by names.

    Attributes:
        pictures: files of photographs.
        cameras: where they were taken from, in their order; ``position``, ``target`` and vertical ``fov_deg``.
        board: where the middle of the printed board lies on the table, x and y, m, and its yaw, degrees.
        board_marker_mm: how wide a marker of the board is, as it was printed; measure it.
        print_board: write the board to this file, PDF or PNG, and nothing else.
        camera_error: how far off the cameras may be, one standard deviation: ``place_m``, ``turn_deg``, ``fov_deg``,
            ``bend`` (of the lens), ``board_m`` and ``board_deg``.
        fov_deg: of photographs whose camera is found, vertical, degrees; not given: what their EXIF says, or 53.
        accept_guesses: go on where a place that a goal needs is the model's guess, which no photograph fixes.
        tries: how often a model may answer.
        output: the file to write.
    """

    pictures: list[str] = field(default_factory=list)
    cameras: list[dict[str, Any]] = field(default_factory=list)
    camera_error: Any = None
    board: list[float] = field(default_factory=list)
    board_marker_mm: float = 50.0
    print_board: str = ""
    fov_deg: float | None = None
    accept_guesses: bool = False
    tries: int = 3
    output: str = "my_scene.yaml"


def main(words: list[str]) -> None:
    """Write a scene file, or change one, and say what was understood.

    Raises:
        UserError: nothing is asked for, the model gave no sound scene, or a file can't be read or written.
    """
    settings = [word for word in words if _SETTING.match(word)]
    known = [word for word in settings if word.startswith("known=")]
    said = [word for word in words if word not in settings]
    given = [word for word in said if word.endswith((".yaml", ".yml"))]
    sentence = " ".join(word for word in said if word not in given)
    others = [word for word in settings if word not in known]
    cfg = load("scene", arguments(USAGE, others), SceneFileConfig)
    if cfg.print_board:
        print_board(cfg.print_board)
        return

    cfg.output = cfg.task.file = (given or [cfg.output])[0]
    output = _find_output(cfg.output)
    if not given and len(sentence.split()) < 2:
        raise UsageError(f"say what is to be done, in a sentence; {USAGE}")

    cameras = OmegaConf.to_container(cfg.cameras)
    error = _read_error(cfg.camera_error)
    photographs = read_photographs(cfg.pictures, cameras, error)
    if cfg.board:
        photographs = find_by_board(
            photographs, list(cfg.board), cfg.fov_deg, cfg.board_marker_mm
        )

    draft = Draft(
        output.with_suffix(".draft.yaml"),
        photographs,
        read_known("".join(known)),
        part(ROBOT, cfg.robot).create(),
        cfg.fov_deg,
        board=tuple(cfg.board),
        marker_mm=cfg.board_marker_mm,
    )
    if given:
        draft.text = read_text(output, cfg.output)

    before = draft.text.splitlines()
    if sentence:
        with open_asker(cfg, output.with_suffix("")) as asker:
            draft.ask(asker, max(cfg.tries, 1), sentence)
    else:
        draft.examine()
    if draft.faults:
        write_bytes(draft.file, draft.text.encode())
        faults = "".join(f"\n- {fault}" for fault in draft.faults)
        raise UserError(
            f"{draft.file} is not sound yet; mend it by hand, or say more in the sentence:{faults}"
        )

    verdicts = judge_numbers(draft)
    guesses = {v.name for v in verdicts if v.source == "guessed" and v.kind == "place"}
    missing = sorted(find_needed(draft.read()) & guesses)
    if missing and photographs and not given and not cfg.accept_guesses:
        write_bytes(draft.file, draft.text.encode())
        raise UserError(
            f"{draft.file}: where {', '.join(missing)} stands is the model's guess, since no photograph whose camera "
            "is known shows it; take one with the board in it (board=[x,y,yaw_deg]), or go on with accept_guesses=true"
        )

    _write(cfg, draft, verdicts)
    if before:
        changes = difflib.ndiff(before, draft.text.splitlines())
        say(*[line for line in changes if line[0] in "+-"])


def _find_output(name: str) -> Path:
    """Return the file to write, where nothing is in its way.

    Raises:
        UsageError: it has no name of a scene file, or a folder or file has the name of what stands beside it.
    """
    output = expand(name)
    if output.suffix not in (".yaml", ".yml"):
        stem = output.with_suffix("") if output.name else output / "my_scene"
        raise UsageError(f"output={name} is no scene file; say output={stem}.yaml")

    for suffix in (output.suffix, ".html", ".draft.yaml"):
        if output.with_suffix(suffix).is_dir():
            raise UsageError(
                f"{output.with_suffix(suffix)} is a folder, and would be written; name another file with output="
            )

    folder = output.with_suffix("")
    if folder.exists() and not folder.is_dir():
        raise UsageError(
            f"{folder} is a file, and photographs would lie in a folder of that name; name another file with output="
        )

    return output


def _read_error(given: Any) -> CameraError:
    if given is None:
        return CameraError()

    if OmegaConf.is_config(given):
        given = OmegaConf.to_container(given)

    try:
        return CameraError.model_validate(given)
    except ValidationError as error:
        raise UsageError(
            f"can't read camera_error={clean(str(given), LONGEST)}; it is how far cameras may be off, such as "
            "camera_error={place_m: 0.01, turn_deg: 1, fov_deg: 1}"
        ) from error


def read_known(word: str) -> dict[str, Any]:
    """Read what a person knows, by any names; Hydra would take a name with a point apart."""
    text = word.removeprefix("known=") or "{}"
    try:
        known = _KNOWN.validate_python(yaml.safe_load(text.replace(":", ": ")))
    except (ValidationError, yaml.YAMLError) as error:
        raise UsageError(
            f"can't read known={clean(text, LONGEST)}; give numbers or places, such as known={{mug.height: 0.095, "
            "table_corner: [1.35, 0.5, 0]}"
        ) from error

    for name, value in known.items():
        far = float(np.abs(value).max())
        limits = [most for ends, most in _LONGEST.items() if ends.search(name)]
        if isinstance(value, tuple):
            limits = [FAR_M]
        if far > min(limits, default=far):
            raise UsageError(
                f"known={{{name}: ...}} is in metres, and has {far:g}; of millimetres that is {far / 1000:g}, of "
                f"centimetres {far / 100:g}; leave out what is longer in fact"
            )

    return known


def _write(cfg: DictConfig, draft: Draft, verdicts: Sequence[Verdict]) -> None:
    """Write the file, its photographs and its page, and say what was understood."""
    output = expand(cfg.output)
    unsaid = [f"not said: {clean(text, LONGEST)}" for text in draft.beside.unsaid]
    for photograph in draft.photographs:
        file = output.with_suffix("") / f"{photograph.picture.name}.png"
        write_bytes(file, photograph.picture.png)

    draft.text = fill(PACKAGE, "file", draft=draft, unsaid=unsaid, folder=output.stem)
    draft.vary()
    task = draft.read()
    draft.file.replace(output)

    words = [*task.reward_in_words(), *unsaid]
    simulator = part(SIMULATOR, cfg.sim).create()
    sightings = draft.beside.sightings
    page = draw_page(task, draft.fitted, sightings, simulator, words, verdicts)
    write_bytes(output.with_suffix(".html"), page.encode())
    say(
        *words,
        *describe_fit(draft.photographs, draft.fit),
        *fill(PACKAGE, "verdicts", verdicts=verdicts).splitlines(),
        *fill(PACKAGE, "done", file=cfg.output, task=task, draft=draft).splitlines(),
    )
