"""A task from a YAML file: its scene, its goals, and the reward that follows from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml

from core.errors import UserError
from core.geometry import Array, Pose, Vector
from core.goals import are_goals_met, goals_margins, goals_reward, reaches
from core.hooks import Harmless, Names
from core.interfaces import JsonObject, Picture, Task
from core.robot.kinematics import arm_of
from core.scene import Margin, Scene, State, Trace
from core.solids.hindrances import find_blocked, find_hindrances
from core.solids.standing import find_overlaps, say_first
from core.support.cli import expand
from core.values.layouts import NONE, Draw, Ranges, Sets
from core.values.warnings import warn_once
from plugins.tasks.file import (
    building,
    contacts,
    copies,
    goals,
    naming,
    photos,
    places,
    scene_warnings,
    tree,
)
from plugins.tasks.file import spec as schema
from plugins.tasks.file.named_files import Files

BACK = 1.25  # times as far: how a camera moves back that sees too little
FARTHEST_M = 10.0
SEEN = "seen"  # the variation of a scene that was seen in photographs: the benches that fit these
SEARCH_WORDS = (f"task.variation={SEEN}", "fitness=layouts")
VARYING = ("bodies", "imports", "marks", "joints")


class FileTask(Task):
    """A task that a YAML file describes; `vlmgineer new scene NAME` writes one that works.

    Args:
        file: the scene file, relative to the working directory.
        variation: what differs between layouts: ``none``, or one of the file's ``variations``.

    Attributes:
        warnings: a line for each thing that is possible but seldom meant, whatever the robot is; they are said at once.

    Raises:
        UserError: the file can't be used; says what is wrong in it, where, and how to mend it.
    """

    language = "yaml"

    def __init__(
        self, file: Annotated[str, Names("file")], variation: Harmless[str] = NONE
    ) -> None:
        path = expand(file)
        self._text, self._tree = tree.Tree.read(path)
        self._files = Files(path.absolute().parent)
        self._build(variation)

    @classmethod
    def from_data(cls, data: Mapping[str, Any], variation: str = NONE) -> FileTask:
        """Make a task of what a scene file would hold, as plain data; it names no files.

        Raises:
            UserError: see the class.
        """
        task = cls.__new__(cls)
        task._text = yaml.safe_dump(dict(data), sort_keys=False, width=120)
        task._tree = tree.Tree(Path(str(data.get("name", "scene"))), task._text)
        task._files = Files(Path())
        task._build(variation)
        return task

    def _build(self, variation: str) -> None:
        """Build the scene and the goals, and check them."""
        spec = self._read_spec(self._tree.data)
        home = spec.home
        self._scene = building.build_scene(self._tree, spec, self._files)
        varied = self._read_variations(spec)
        # Attributes of the object hide those of the class.
        vars(self).update(
            name=spec.name,
            description=" ".join(spec.description.split()),
            in_words=" ".join(spec.in_words.split()),
            camera=spec.camera,
            success_reward=spec.success_reward,
            every=spec.every,
            hold_s=spec.hold_s,
            noise_m=spec.noise_m,
            tool_kinds=spec.tool_kinds,
            fixture=building.build_region(spec),
            tool_in_place=spec.tool_in_place,
            payload_kg=spec.payload_kg,
            variations={name: _bound_sets(given) for name, given in varied.items()},
            home=Pose.xyz_rpy(home.position, np.radians(home.rpy_deg)),
        )
        self._photographs = spec.pictures
        self._sets: dict[str, Sets] = {
            name: {path: values for path, values in given.items() if len(values) > 2}
            for name, given in varied.items()
        }
        if SEEN in self.variations:
            vars(self).update(search_words=SEARCH_WORDS)
        Task.__init__(self, variation)
        wanted = naming.build_goals(self._tree, spec, self._scene)
        vars(self).update(goals=wanted)
        self._look_at(spec)
        self._check_variations()
        self.warnings = (
            *scene_warnings.find_warnings(self._scene),
            *scene_warnings.find_far_bonds(self._scene),
            *scene_warnings.find_radians(_list_turns(spec)),
            *scene_warnings.find_idle_goals(self._scene, self.goals, self.every),
            *scene_warnings.find_unrewarded(self.description, self.goals),
        )
        for warning in self.warnings:
            warn_once(f"{self._tree.file}: {warning}")

    def _read_spec(self, data: Mapping[str, Any]) -> schema.SceneSpec:
        """Check what the file says, or the same with other numbers."""
        return self._tree.check(schema.SceneSpec, schema.name_pictures(data))

    def _read_variations(self, spec: schema.SceneSpec) -> dict[str, copies.Values]:
        """Read the variations: what each path stands for, and its range.

        Raises:
            UserError: a path leads to no number.
        """
        found = {}
        for name, given in spec.variations.items():
            found[name] = copies.Values()
            for path, wanted in given.items():
                problem = _find_stranger(path)
                if not problem:
                    try:
                        found[name] |= copies.read_range(
                            self._tree.data, path, wanted, self._files
                        )
                    except (LookupError, TypeError, ValueError):
                        problem = tree.MISSING

                if problem:
                    raise self._tree.error(("variations", name, path), problem)

        return found

    def _look_at(self, spec: schema.SceneSpec) -> None:
        """Move the camera back until it sees the goals' bodies; where the file gives one, say which it does not see."""
        state = self._scene.state()
        bodies = dict.fromkeys(
            body for goal in reaches(self.goals) for body in goal.subjects(state)
        )
        camera = spec.camera
        unseen = scene_warnings.find_unseen(camera, state, bodies)
        if "camera" in spec.model_fields_set:
            for name in unseen:
                line = f"body {name} of a goal is outside of the picture; move camera"
                warn_once(f"{self._tree.file}: {line}")

            return

        while unseen and np.linalg.norm(camera.position) < FARTHEST_M:
            x, y, z = BACK * np.array(camera.position)
            camera = replace(camera, position=(float(x), float(y), float(z)))
            unseen = scene_warnings.find_unseen(camera, state, bodies)

        vars(self).update(camera=camera)

    @staticmethod
    def json_schema() -> JsonObject:
        """Describe what a scene file may say as a JSON Schema."""
        return schema.json_schema()

    def find_warnings(self) -> Iterator[str]:
        """See `core.interfaces.Task.find_warnings`; what needs no robot is said where the file is read."""
        overlaps = [fault.text for fault in find_overlaps(self._scene)]
        yield from say_first(overlaps, "pairs of bodies overlap")
        arm = arm_of(self.robot)
        for goal in reaches(self.goals):
            yield from places.find_far(goal, arm, self._scene)
            yield from contacts.find_buried(goal, self._scene)

        yield from find_hindrances(self.goals, self._scene)

    def photographs(self) -> list[Picture]:
        """See `core.interfaces.Task.photographs`."""
        folder = self._files.folder
        given = enumerate(self._photographs, 1)
        return [
            photos.read_photograph(folder, photo.file, photo.camera, f"photo{n}")
            for n, photo in given
        ]

    def draw(self, seed: int) -> Draw:
        """See `core.interfaces.Task.draw`."""
        sets = self._sets.get(self.variation, {})
        return Draw(self.ranges, seed, sets)

    def scene(self, seed: int) -> Scene:
        if self.variation == NONE:
            return self._nominal

        draw = self.draw(seed)
        drawn = self.with_numbers({path: draw(path, 0.0) for path in self.ranges})
        return replace(drawn, hindered=find_blocked(self.goals, drawn))

    @cached_property
    def _nominal(self) -> Scene:
        return replace(self._scene, hindered=find_blocked(self.goals, self._scene))

    def with_numbers(self, numbers: dict[str, float]) -> Scene:
        """Build the scene with other numbers.

        Raises:
            UserError: they can't be.
        """
        data = copies.unfold(deepcopy(self._tree.data), numbers, self._files)
        starts = dict[str, float]()
        for path, number in numbers.items():
            holder, key = tree.follow(data, path)
            if path.startswith("joints.") and key == "start":
                starts[holder["name"]] = number
            else:
                holder[key] = number

        spec = self._read_spec(data)
        scene = building.build_scene(self._tree, spec, self._files)
        if not starts:
            return scene

        try:
            return scene.with_starts(starts)
        except ValueError as error:
            raise UserError(str(error)) from error

    def _check_variations(self) -> None:
        """Refuse ranges that lead to a scene that can't be.

        Raises:
            UserError: says which.
        """
        for name, ranges in self.variations.items():
            sets = self._sets[name]
            for end in (0, 1):
                numbers = [
                    (path, ranges[path][end]) for path in ranges if path not in sets
                ]
                self._check_numbers(name, numbers)

            for values in zip(*sets.values(), strict=True):
                self._check_numbers(name, list(zip(sets, values, strict=True)))

    def _check_numbers(
        self, variation: str, numbers: Sequence[tuple[str, float]]
    ) -> None:
        """Refuse numbers that can't be in one scene, by the first that can't be with those before it.

        Raises:
            UserError: says which.
        """
        with suppress(UserError):
            self.with_numbers(dict(numbers))
            return

        for count, (path, number) in enumerate(numbers, 1):
            try:
                self.with_numbers(dict(numbers[:count]))
            except UserError as error:
                where = ("variations", variation, path)
                raise self._tree.error(
                    where, f"{number:g} can't be: {error}"
                ) from error

    @property
    def reads_trace(self) -> bool:
        return any(goal.needs_trace for goal in self.goals)

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """Compute the reward that the goals stand for."""
        return goals_reward(self, start, end, trace)

    def is_solved(
        self, reward: float, start: State, end: State, trace: Trace | None = None
    ) -> bool:
        """Say whether all is as the goals ask; where the file has a ``success_reward``, that it is earned."""
        if self.success_reward < 1:
            return super().is_solved(reward, start, end, trace)

        return are_goals_met(self, start, end, trace)

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> list[Margin]:
        return goals_margins(self, start, end, trace)

    def reward_in_words(self) -> list[str]:
        return goals.describe_goals(self.goals, self.every)

    def source(self) -> str:
        return self._text


def _list_turns(spec: schema.SceneSpec) -> dict[str, Vector]:
    """List the turns that a file writes, by what turns."""
    turns: dict[str, Vector] = {"home": spec.home.rpy_deg}
    for body in spec.bodies:
        turns[f"body {body.name}"] = body.rpy_deg
        for number, part in enumerate(body.parts or ()):
            turns[f"part {number} of {body.name}"] = part.rpy_deg

    turns |= {f"mark {mark.name}": mark.rpy_deg for mark in spec.marks}
    return turns | {other.file: other.rpy_deg for other in spec.imports}


def _bound_sets(given: Mapping[str, Sequence[float]]) -> Ranges:
    """Return the range of each number; two values are one."""
    ranges = dict[str, tuple[float, float]]()
    for path, values in given.items():
        if len(values) == 2:
            ranges[path] = (values[0], values[1])
        else:
            ranges[path] = (min(values), max(values))

    return ranges


def _find_stranger(path: str) -> str:
    """Say what is wrong with a path by its first word; empty: nothing."""
    if path.partition(".")[0] in VARYING:
        return ""

    hint = "such as bodies.cup.mass"
    if path.startswith("goals"):
        hint = "to vary a goal, put it `at` a mark"

    return f"only numbers of {', '.join(VARYING)} can vary; {hint}"
