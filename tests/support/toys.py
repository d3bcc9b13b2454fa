"""Cheap stand-ins for a model, an engine and an executor, so that a whole run takes a second.

Requests and rollouts are noted in `Notes`, one line each, which outlive a process that is killed.
"""

from __future__ import annotations

import json
import os
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig, OmegaConf

from core.config.compose import load
from core.design import Component, Tool
from core.errors import LimitReached
from core.geometry import Box, Pose
from core.hooks import hookimpl
from core.interfaces import VLM, Executor, Outcome, Reply, Simulator
from core.plugins import Offer, Plugins
from core.scene import State
from core.search.trials import key_of
from plugins.actions.anchored import AnchoredActions
from tests.support.executors import Inline


class Notes:
    """A file of lines, each written at once."""

    def __init__(self, file: str) -> None:
        self.file = Path(file)

    def add(self, line: str) -> None:
        descriptor = os.open(self.file, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(descriptor, f"{line}\n".encode())
        os.close(descriptor)

    def lines(self, kind: str) -> list[str]:
        """Return the lines that begin with ``kind``, without it."""
        lines = self.file.read_text().splitlines() if self.file.exists() else []
        return [
            line.removeprefix(f"{kind} ")
            for line in lines
            if line.startswith(f"{kind} ")
        ]


class ToyModel(VLM):
    """Design rods at random. Agent 1 gives no JSON, agent 2 gets an error, agent 3 repeats agent 0. With ``limit`` it
    answers that many requests, including those that were answered before the run was resumed. The service is ``down``
    for requests whose ids match.
    """

    model = "a toy"

    def __init__(
        self,
        notes: str,
        limit: int | None = None,
        only_agent: int | None = None,
        down: str = "",
    ) -> None:
        self.notes = Notes(notes)
        self.limit = limit
        self.only_agent = only_agent  # all agents are like this one
        self.answered: set[str] = set()
        self.down = down

    @hookimpl
    def reply_received(self, reply):
        self.answered.add(reply.request_id)

    def complete(self, requests):
        for i, request in enumerate(requests):
            if self.limit is not None and len(self.answered) >= self.limit:
                raise LimitReached(
                    f"{self.limit} replies are all there may be; {len(requests) - i} are left without"
                )
            if self.down and re.fullmatch(self.down, request.id):
                yield Reply(
                    request.id, "", self.model, "service is down", unanswered=True
                )
                continue
            self.notes.add(f"asked {request.id}")
            agent = (
                request.brief.agent if self.only_agent is None else self.only_agent
            ) % 4
            text = (
                ""
                if agent == 2
                else "I would rather not."
                if agent == 1
                else answer(request.brief)
            )
            yield Reply(
                request.id,
                text,
                self.model,
                "out of order" if agent == 2 else None,
                1000,
                500,
                0.01,
            )


def answer(brief) -> str:
    rng = np.random.default_rng(
        [brief.scene_seed, brief.generation, brief.agent % 3, len(brief.elites)]
    )
    strategies = []
    for number in range(brief.n_tool):
        rod = Box((0.02, 0.02, round(float(rng.uniform(0.1, 0.3)), 3)))
        pose = Pose.xyz_rpy((0.0, 0.0, -rod.size[2] / 2))
        plans = [
            [
                [
                    round(float(rng.uniform(0.4, 0.6)), 3),
                    round(float(rng.uniform(-0.2, 0.2)), 3),
                    0.5,
                    0,
                    0,
                    0,
                ]
            ]
            for _ in range(brief.n_action)
        ]
        if number == 1 and plans:
            plans[0] = [[9.0, 0.0, 0.0, 0.0, 0.0, 0.0]]  # breaks a rule
        if isinstance(brief.actions, AnchoredActions):
            plans = [feel_down(*plan[0][:3]) for plan in plans]
        strategies.append(
            {
                "strategy_name": f"rod {number}",
                "gripper": False,
                **brief.representation.dump(
                    Tool((Component("rod", "tool_mount", pose, rod),))
                ),
                "action_sets": plans,
                "parents": [elite.candidate.id for elite in brief.elites[:2]],
            }
        )
    return json.dumps({"strategies": strategies})


def feel_down(x: float, y: float, z: float) -> list[dict[str, Any]]:
    """Return a plan of two waypoints: the second lies below the first, and ends at a touch."""
    below = {"offset": [x, y, z - 0.4], "until": "touch"}
    return [{"offset": [x, y, z]}, below]


class ToyEngine(Simulator):
    """Move the cube by a number from the tool's length and the arm's last joints; some rods break."""

    def rollout(self, task, jobs):
        return [self._outcome(task, job) for job in jobs]

    def _outcome(self, task, job):
        start = task.scene(job.seed).state()
        length = job.tool.components[0].shape.size[2]
        number = float(np.abs(job.trajectory.arm[-1]).sum()) * length
        if number % 0.07 < 0.01:
            return Outcome(None, None, error="the rod broke")
        end = State(
            start.names,
            start.positions - np.array([number % 0.4, 0.0, 0.0]),
            *vars_of(start),
        )
        return Outcome(
            start,
            end,
            tracking_error_rad=number / 3,
            warnings=("it bent",) if length > 0.25 else (),
        )

    def render(self, task, *, width=64, height=48, **_):
        return np.full((height, width, 3), 128, dtype=np.uint8)


def vars_of(state: State) -> tuple[Any, ...]:
    return state.quaternions, state.linear_velocities, state.angular_velocities


def noted(notes: Notes, chunks):
    """Note what is handed to an executor."""
    for chunk in chunks:
        for candidate in chunk:
            content, where = key_of(candidate, chunk.condition)
            notes.add(f"tried {content} {where}")
        yield chunk


def note_chunks(executor: type[Executor], notes: Notes) -> None:
    """Note what is handed to all executors of a class from now on."""
    plain = executor.map
    executor.map = lambda self, function, chunks: plain(
        self, function, noted(notes, chunks)
    )


class Here(Inline):
    """Note what is tried. An interrupt comes with chunk number ``fails_at``, counted from 1."""

    def __init__(self, notes: str, fails_at: int | None = None) -> None:
        super().__init__()
        self.notes = Notes(notes)
        self.fails_at = fails_at

    def map(self, function, chunks):
        return super().map(function, noted(self.notes, self.until_it_fails(chunks)))

    def until_it_fails(self, chunks):
        for chunk in chunks:
            if len(self.chunks) + 1 == self.fails_at:
                raise KeyboardInterrupt
            yield chunk


OFFERED = {
    ("vlm", "toy"): ToyModel,
    ("sim", "toy"): ToyEngine,
    ("executor", "here"): Here,
}


def offered() -> dict[tuple[str, str], Offer]:
    """Return the toys as a plugin offers them."""
    return {
        (kind, name): Offer(kind, name, "toys", "tests", factory)
        for (kind, name), factory in OFFERED.items()
    }


def offer(plugins: Plugins) -> None:
    """Register the toys."""
    plugins.offers.update(offered())


def config(notes: Path, *overrides: str) -> DictConfig:
    """Return the configuration of a run with toys: two generations of 14 candidates. Of each, 2 stand for unusable
    replies, 2 break a rule, and 5 are identical to 5 others.
    """
    cfg = composed(overrides).copy()
    OmegaConf.update(cfg, "vlm", {"name": "toy", "notes": str(notes)}, merge=False)
    OmegaConf.update(cfg, "sim", {"name": "toy"}, merge=False)
    OmegaConf.update(
        cfg, "executor", {"name": "here", "notes": str(notes)}, merge=False
    )
    return cfg


def several(notes: Path, *overrides: str) -> DictConfig:
    """Return the configuration of a run with two toys as models, one of which criticises."""
    cfg = config(notes, "prompt.critic=2", *overrides)
    members = [
        {"name": "toy", "notes": str(notes)},
        {"name": "toy", "notes": str(notes), "only_agent": 0},
    ]
    OmegaConf.update(
        cfg, "vlm", {"name": "ensemble", "members": members, "seed": 5}, merge=False
    )
    return cfg


@lru_cache
def composed(overrides: tuple[str, ...]) -> DictConfig:
    sizes = [
        "budget.n_agent=4",
        "budget.n_tool=2",
        "budget.n_action=3",
        "budget.n_iteration=1",
        "budget.final_s=0",
        "budget.k_top=3",
    ]
    fixed = [
        "task=BringCube",
        "budget.reward_save=0.0",
        "seed=5",
        "film=false",
        "listener=[]",
        "second=[]",  # its physics is that of no other engine
    ]
    return load("config", [*sizes, *fixed, *overrides])
