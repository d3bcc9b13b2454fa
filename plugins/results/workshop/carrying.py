"""Carry an exported plan out on a real arm, or in an engine as a dry run: ``python run_plan.py`` of an export.

The loop is the same for every arm. A driver moves it until a guard fires, and a function says where bodies are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from omegaconf import DictConfig, OmegaConf

from core.config.compose import engines, node, task_parts, tool_part
from core.designs.planning import resolve_seen
from core.designs.sighting import SceneJudge
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import (
    Condition,
    Look,
    RolloutSettings,
    Seen,
    Sighted,
    Task,
    Waypoints,
)
from core.plugins import PluginPart
from core.scene import Scene
from core.support.cli import expand, path_exists, say
from core.support.templates import macros
from plugins.results.chosen import chosen_evaluations
from plugins.results.workshop.life_size import Ratio, to_life
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.policy import ExportedPlan, Move, Policy, Stopped
from plugins.results.workshop.replay import PlayedMotion, play_motion

SETTINGS = "settings.yaml"
DESIGN = "design.json"

Perceive = Callable[[], Mapping[str, Sequence[float]]]
"""Says where bodies are: by name x, y, z in metres, and the quaternion w, x, y, z, in the world's frame."""


class Driver(Protocol):
    """Moves an arm."""

    def move_until(self, move: LifeSizeMove) -> Stopped | None:
        """Follow the samples of a move, and ask `Move.has_fired` every 10 ms or more often.

        Returns:
            Where the arm rests after a guard fired; None: the move came to its end.

        Raises:
            RuntimeError: the arm is not where the move begins, or stopped by itself.
        """


def play_dry(exported: ExportedPlan, engine: str) -> PlayedMotion:
    """Play an exported plan in an engine, move by move; what is seen is what the engine's world shows.

    Raises:
        UserError: there is no such engine, or it can't play the plan.
    """
    sim = engines([engine])[engine]
    where = Condition(
        exported.task, sim, exported.layout, exported.settings, engine=engine
    )

    return play_motion(where, exported.scene, exported.tool, exported)


def dump_settings(cfg: DictConfig, task: PluginPart[Task]) -> dict[str, Any]:
    """Return the settings of an export that `load_export` needs.

    Args:
        cfg: the settings of the command.
        task: one of those that are exported.
    """
    sections = ("robot", "tool", "material", "rollout")
    settings = {key: OmegaConf.to_container(cfg[key], resolve=True) for key in sections}
    return {
        "task": {"name": task.name, **_name_files(dict(task.settings))},
        **settings,
        "robot": _name_files(settings["robot"]),
        "seed": cfg.seed,
        "rate_hz": cfg.rate_hz,
    }


def _name_files(settings: Any) -> dict[str, Any]:
    """Return settings with whole paths of files, since a plan is carried out in a folder of its own."""
    named = dict(settings)
    for key, value in settings.items():
        if key == "name" or not isinstance(value, str) or not path_exists(value):
            continue
        if expand(value).is_file():
            named[key] = str(expand(value).absolute())

    return named


def load_export(folder: Path, speed: float = 1.0) -> ExportedPlan:
    """Read the folder ``plan`` of an export, to be carried out with a share of the planned speed.

    Raises:
        UserError: it holds none, or one that can't be used here.
    """
    try:
        cfg = OmegaConf.load(folder / SETTINGS)
    except OSError as error:
        raise UserError(f"{folder}: no exported plan: {error}") from error

    assert isinstance(cfg, DictConfig)
    cfg.designs = str(folder / DESIGN)
    (part,) = task_parts(cfg)
    representation = tool_part(cfg).create()
    (chosen, *_) = chosen_evaluations(cfg, representation, part.shared())
    candidate = chosen.candidate.of(part.shared().name)
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"{folder}: the plan can't be used: {candidate.problem}")

    rollout = OmegaConf.merge(OmegaConf.structured(RolloutSettings), cfg.rollout)
    assert isinstance(rollout, DictConfig)
    settings = node(rollout, RolloutSettings)
    rate_hz = cfg.rate_hz * to_life(part.shared().robot).time
    return ExportedPlan(part, candidate, cfg.seed, settings, rate_hz, speed)


@dataclass(frozen=True, eq=False)
class LifeSizeMove:
    """A move in the size of the arm that stands in the lab; readings are compared in the simulated size.

    Attributes:
        planned: the move in the simulated size.
        to_life: leads from the simulated size to the arm's own one.
    """

    planned: Move
    to_life: Ratio

    @cached_property
    def samples(self) -> Sampled:
        """The motion, at a fixed rate."""
        return self.to_life.samples(self.planned.samples)

    def has_fired(self, time: float, joints: Array, force: Array) -> bool:
        """Take a reading, and report whether the arm must stop now; see `Move.has_fired`."""
        large = self.to_life.inverse
        return self.planned.has_fired(
            large.time * time, large.joints(joints), large.force * force
        )


class Perceived:
    """Makes what a plan can use of what a function sees.

    Args:
        perceive: says where bodies are, in the size of the arm that stands in the lab.
        scene: the layout of the export, in the simulated size.
        to_life: leads from the simulated size to the arm's own one.
    """

    def __init__(self, perceive: Perceive, scene: Scene, to_life: Ratio) -> None:
        self._perceive = perceive
        self._scene = scene
        self._enlarge = to_life.inverse.pose

    def first(self) -> Sighted:
        """Look before the motion: all that can move must be seen.

        Raises:
            RuntimeError: names what is not seen.
        """
        seen = self._read()
        missing = [body.name for body in self._scene.free if body.name not in seen]
        if missing:
            raise RuntimeError(f"perceive() does not see {', '.join(missing)}")

        known = {body.name: body.pose for body in self._scene.bodies}
        return Sighted({**known, **seen})

    def look(self, before: Sighted, at_s: float, known_s: float) -> Sighted:
        """Look again: what is not seen is taken to be where it was.

        Args:
            before: what was seen by the look before.
            at_s: now, seconds since the plan began.
            known_s: when the plan goes on.
        """
        seen = self._read()
        hidden = {
            body.name: before.taken_s.get(body.name, before.at_s)
            for body in self._scene.free
            if body.name not in seen
        }
        return Sighted({**before.poses, **seen}, at_s, known_s, hidden)

    def _read(self) -> dict[str, Pose]:
        """Read what the function returns.

        Raises:
            RuntimeError: a body is none of the scene's, or has no seven finite numbers.
        """
        names = [body.name for body in self._scene.bodies]
        poses = {}
        for name, values in self._perceive().items():
            numbers: Array = np.asarray(values, dtype=np.float64)
            if name not in names:
                raise RuntimeError(
                    f"perceive() has {name!r}; possible: {', '.join(names)}"
                )
            usable = numbers.shape == (7,) and np.isfinite(numbers).all()
            length = float(np.linalg.norm(numbers[3:])) if usable else 0.0
            if abs(length - 1) > 0.01:
                raise RuntimeError(
                    f"perceive(): {name} needs x, y, z and a unit quaternion w, x, y, z, got {values}"
                )
            poses[name] = self._enlarge(Pose(numbers[:3], numbers[3:] / length))

        return poses


def carry_out(
    exported: ExportedPlan,
    driver: Driver,
    perceive: Perceive,
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], None] = time.sleep,
) -> Policy:
    """Carry an exported plan out, and return how it went.

    Args:
        exported: the plan, and its speed.
        driver: moves the arm.
        perceive: says where bodies are.
        clock: says the time, seconds.
        wait: waits so many seconds.

    Raises:
        DesignError: the plan means nothing in this scene.
        RuntimeError: the arm or the function fails.
    """
    task = exported.task.shared()
    scene = exported.scene
    settings = exported.settings
    life = to_life(task.robot)
    eyes = Perceived(perceive, scene, life)
    first = eyes.first()
    judge = SceneJudge(task, scene, first.poses)

    def resolve(felt: tuple[Pose | None, ...], looks: tuple[Sighted, ...]) -> Waypoints:
        seen = Seen(first.poses, felt, looks, judge)
        return resolve_seen(exported.candidate.plan, task, settings, seen)

    policy = Policy(resolve, exported)
    step: Move | Look | None = policy.begin()
    begun = clock()

    while step is not None:
        if isinstance(step, Move):
            move = LifeSizeMove(step, life)
            stopped = driver.move_until(move)
            say(macros("plugins.results.workshop", "words").moved(move, stopped))
            if stopped is not None:
                stopped = stopped._replace(
                    time=stopped.time / life.time,
                    joints=life.inverse.joints(stopped.joints),
                )
            step = policy.moved(stopped)
            continue

        at_s = (clock() - begun) / life.time
        known_s = at_s + settings.perception.look_s
        before = policy.looks[-1] if policy.looks else first
        seen = eyes.look(before, at_s, known_s)
        say(f"looked{f', {step.where}' if step.where else ''}")
        step = policy.saw(seen)
        late_s = clock() - begun - known_s * life.time
        if late_s > 0:
            say(f"the look took {late_s:.2f} s more than rollout.perception.look_s")

        wait(max(0.0, -late_s))

    if policy.problem:
        say(f"the plan ended early: {policy.problem}")

    return policy
