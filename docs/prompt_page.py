"""Make the contents of ``docs/prompts.md``: the size of each prompt, and a whole one.

Held up to date by ``tests/test_docs.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Unpack, cast

import numpy as np

from core.config.compose import load, node, part
from core.config.schemas import PromptSettings
from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Candidate, Component, Evaluation, Tool
from core.designs.composer import PromptComposer, as_markdown
from core.geometry import Box, Pose
from core.interfaces import Brief, Image, Message, Picture, Simulator, Task, Text, View
from core.search.prompt_pictures import prompt_pictures
from plugins.vlms.litellm.client import load as litellm

MODEL = "gemini/gemini-2.5-pro"  # LiteLLM counts alike for most models
IDEA = Path(__file__).parent / "ideas" / "one_book_layperson.md"
# The tokens of the same prompts at commit 02e21a8.
EARLIER = {
    "first sampling": 9023,
    "first sampling, gripper": 10743,
    "evolution of five elites": 24117,
    "evolution of five elites, `prompt=evolve`": 24117,
    "evolution of five elites, `prompt.feedback=numbers`": 25905,
    "a person's idea": 9288,
    "plans for a given tool": 8010,
    "plans for the bare gripper": 9329,
}
TOLD = ("source", "words", "pictures")
LEVELS = [f"| task | {' | '.join(f'`{told}`' for told in TOLD)} |", "|---|" + "---|" * len(TOLD)]
CRITIQUE = "a critique of one candidate, `prompt.critic`"


def elite(number: int, boxes: int = 8, *, gripper: bool = False) -> Evaluation:
    """Make an elite with a hook of ``boxes`` boxes."""
    mount = GRIPPER_MOUNTS[0] if gripper else RIGID_MOUNT
    length = 0.35 + 0.025 * number
    parts = [Component("shaft", mount, Pose.xyz_rpy((0.0945, 0, -0.1625), (0, -0.525, 0)), Box((0.02, 0.02, length)))]
    for k in range(1, boxes):
        pose = Pose.xyz_rpy((0.0125 * k, 0.06 * (-1) ** k, -0.0425), (0, 0.525, 0) if k == 1 else (0, 0, 0))
        parts.append(Component(f"wall_{k}", parts[-1].name, pose, Box((0.125, 0.0125, 0.0725)), mass=0.0125))
    text = "Reaches over the body, lowers a wall behind it, and pulls it back between side walls that keep it straight."
    tool = Tool(tuple(parts), gripper, name=f"hook with side walls {number}", description=text)
    plan = np.array([[0.5 - 0.04 * k, 0.0, 0.4 - 0.025 * k, 0.0, 0.1 * k, 0.0] for k in range(8)])
    candidate = Candidate(tool, plan, strategy=number, strategy_name="pull from behind", strategy_description=text)
    figures = {"distance_m": 0.9123, "ik_error_m": 0.0012, "ik_error_rad": 0.0021, "tracking_error_rad": 0.0143}
    return Evaluation(candidate, "ok", reward=0.9 - 0.05 * number, moved_m={"cube": 0.3612}, **figures)


def messages(use: str) -> tuple[Message, ...]:
    """Compose the prompt of a use for BringCube: ten tools with ten plans, at the settings of the paper."""
    name = "none" if "bare" in use else "rlbench" if "given" in use else "urdf"
    words = ["prompt=evolve"] if "prompt=evolve" in use else []
    words += ["prompt=human", f"prompt.file={IDEA}"] if "idea" in use else []
    words += ["prompt.feedback=numbers"] if "numbers" in use else []
    words += ["prompt.critic=1"] if use == CRITIQUE else []
    cfg = load("prompt", ["task=BringCube", f"tool={name}", "budget=paper", *words])
    given = name != "urdf"
    brief = Brief(
        task=part("task", cfg.task).create(),
        scene_seed=0,
        representation=part("tool", cfg.tool).create(),
        gripper="gripper" in use,
        n_tool=1 if given else 10,
        n_action=10,
        generation=0,
        agent=0,
        seed=0,
        elites=tuple(elite(k) for k in range(5)) if "elites" in use else (),
        actions=part("action", cfg.action).create(),
    )
    composer = PromptComposer(node(cfg.prompt, PromptSettings), engine="pybullet")
    if use == CRITIQUE:
        return composer.critique(replace(brief, elites=(elite(0),)), {})
    return composer.compose(brief, [Picture(b"", "BringCube")])


class Blank:
    """Stands in for a simulator: captions and counts of pictures are those of any."""

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        return np.zeros((view.get("height", 480), view.get("width", 640), 3), dtype=np.uint8)


def told_less(task: str, told: str) -> tuple[int, int]:
    """Count the tokens of a first prompt's texts at a level of ``prompt.told``, and its pictures."""
    cfg = load("prompt", [f"task={task}", "vlm=replay", "budget=paper", f"prompt.told={told}"])
    settings, made = node(cfg.prompt, PromptSettings), part("task", cfg.task).create()
    actions = part("action", cfg.action).create()
    brief = Brief(made, 0, part("tool", cfg.tool).create(), False, 10, 10, 0, 0, 0, (), actions=actions)
    composer = PromptComposer(settings, engine="pybullet")
    shown, _ = prompt_pictures(made, cast(Simulator, Blank()), composer, 0, [Tool()])
    composed = composer.compose(brief, shown[False])
    return counted(composed), len(shown[False])


def levels(tasks: Sequence[str]) -> list[str]:
    """Write a row for each task: tokens at each level, and the pictures."""
    rows = []
    for task in tasks:
        found = [told_less(task, told) for told in TOLD]
        rows.append(f"| {task} | " + " | ".join(f"{tokens:,} + {pictures}" for tokens, pictures in found) + " |")
    return rows


def tokens(use: str) -> int:
    """Count the tokens of a prompt's texts, without pictures."""
    return counted(messages(use))


def counted(messages: Sequence[Message]) -> int:
    """Count the tokens of the texts of messages."""
    counter = litellm().token_counter
    texts = [part.text for message in messages for part in message.parts if isinstance(part, Text)]
    return sum(int(counter(model=MODEL, text=text)) for text in texts)


def contents() -> str:
    """Write the page's table and the whole prompt."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield from ("", "| prompt | earlier | now |", "|---|---|---|")
    for use, before in EARLIER.items():
        yield f"| {use} | {before:,} | {tokens(use):,} |"
    yield f"| {CRITIQUE} | | {tokens(CRITIQUE):,} |"
    yield from (
        "",
        "## A whole prompt",
        "",
        "The first prompt of BringCube. Its system message, then the user's:",
        "",
    )
    yield "````text"
    texts = (as_markdown(message).strip() + "\n" for message in messages("first sampling"))
    yield "\n".join(texts).replace("](BringCube.png)", "](images/tasks/BringCube.png)").rstrip()
    yield from ("````", "")
