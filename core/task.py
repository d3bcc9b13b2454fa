"""Define the interface of a task. Plugins import it from `core.interfaces`."""

from __future__ import annotations

import inspect
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from core.errors import UsageError, choices
from core.geometry import Array, Pose
from core.goals import Goal, goals_margins, reaches
from core.scene import Camera, Region, Scene, State, Trace
from core.values.harmless import Harmless
from core.values.jobs import Perception
from core.values.layouts import NONE, Draw, Ranges
from core.values.margins import ROUNDING, Margin, least_first
from core.values.messages import Picture
from core.values.observations import Sight
from core.values.robots import Robot
from core.values.tools import Fixture


@dataclass(frozen=True)
class Proof:
    """Designs that show what a scene takes, as a designs file has them; no model is shown these.

    Attributes:
        reference: it solves the scene.
        simpler: it must not; else the scene takes no thought.
    """

    reference: Mapping[str, Any]
    simpler: Mapping[str, Any]


class Task(ABC):
    """A manipulation task: a scene, a goal, and a reward. The model reads its source file as it is.

    Args:
        variation: what differs between layouts: ``none``, or a key of ``variations``.

    Attributes:
        description: one paragraph, for the model.
        in_words: the same without places, sizes and masses, for a model that is told less.
        goals: the same, for programs.
        every: whether all goals to reach count; else one is enough.
        hold_s: the least time after the plan, s; the rollout's own setting may be longer.
        noise_m: how far off plans see places at least (standard deviation of x and y); the rollout's own may be more.
        home: the end-effector's pose in the world at the start.
        success_reward: of a solved task, see `is_solved`; less than 1 where the task has a rule of its own.
        variations: by name, what `draw` draws at random, and from which range.
        tool_kinds: that a tool for it may have, where its configuration names none.
        fixture: where a designed fixture may stand (`core.design.Fixture`); None: there can be none.
        tool_in_place: whether the tool waits on site, so that it may start where nothing could have brought it.
        payload_kg: the most that a tool may weigh, if that is less than the arm carries.
        sources: what makes its `parts`, where there are several.
        builder: of its searches; None: `core.search.builder.SearchBuilder`.
        language: of the source that a model is shown.
        search_words: words of ``core.run`` with which it is searched, where nothing is said of its variation.
        proof: that its scenes can be solved, and not by anything; None: nobody has shown it.
        robot: the arm that performs the task; the program makes a task for one.

    Raises:
        UsageError: the task has no such variation.
    """

    name: ClassVar[str]
    description: ClassVar[str]
    in_words: ClassVar[str] = ""
    goals: ClassVar[tuple[Goal, ...]]
    every: ClassVar[bool] = False
    hold_s: ClassVar[float] = 0.0
    noise_m: ClassVar[float] = 0.0
    home: ClassVar[Pose] = Pose(np.array([0.5, 0.0, 0.5]))
    camera: ClassVar[Camera] = Camera()
    success_reward: ClassVar[float] = 1.0
    variations: ClassVar[Mapping[str, Ranges]] = {}
    variation: str = NONE
    tool_kinds: Sequence[str] = ()
    fixture: Region | None = None
    tool_in_place: bool = False
    payload_kg: float | None = None
    sources: Sequence[Any] = ()
    builder: ClassVar[type | None] = None
    language: ClassVar[str] = "python"
    search_words: Sequence[str] = ()
    proof: Proof | None = None
    robot: Robot

    def __init__(self, variation: Harmless[str] = NONE) -> None:
        if variation not in (NONE, *self.variations):
            raise choices(
                "variation",
                variation,
                (NONE, *self.variations),
                f"the task {self.name}",
            )
        self.variation = variation

    @property
    def parts(self) -> tuple[Task, ...]:
        """The tasks in which a tool is tried: this one. A task of several parts has `sources`, too."""
        return (self,)

    @property
    def ranges(self) -> Ranges:
        """What the task's variation draws at random, and from which range."""
        return self.variations.get(self.variation, {})

    def draw(self, seed: int) -> Draw:
        """Return the numbers of the layout of ``seed``, for `scene`."""
        return Draw(self.ranges, seed)

    def perceive(self, perception: Perception) -> Perception:
        """Return how exactly plans see its scenes: as a rollout's settings say, or worse where it has ``noise_m``."""
        if self.noise_m <= perception.position:
            return perception

        return replace(perception, position=self.noise_m)

    @abstractmethod
    def scene(self, seed: int) -> Scene:
        """Return the bodies of the world. The same seed gives the same layout; a fixed layout ignores the seed."""

    @cached_property
    def reads_trace(self) -> bool:
        """Whether its reward is ``reward(start, end, trace)``; then rollouts are recorded, with forces.

        Raises:
            UsageError: the reward takes something else.
        """
        signature = inspect.signature(type(self).reward)
        reads = [*signature.parameters][3:4] == ["trace"]
        given = ("start", "end", "trace") if reads else ("start", "end")

        try:
            signature.bind(self, *given)
        except TypeError as error:
            raise UsageError(
                f"task {self.name}: reward{signature} must be reward(self, start, end) or (self, start, end, trace)"
            ) from error

        return reads

    @abstractmethod
    def reward(self, start: State, end: State) -> Array:
        """Compute rewards from 0 to 1, of one world or of many: from states (..., B, 3) of B bodies, rewards (...).

        ``start`` is after settling and before the motion, ``end`` is after it. Both have the places of marks and fixed
        bodies too: take goals from there, since they differ between layouts. With a third parameter, ``trace``,
        it gets what happened in between too (`Trace`).
        """

    def is_solved(
        self, reward: float, start: State, end: State, trace: Trace | None = None
    ) -> bool:
        """Say whether one world is solved. All who ask that ask here.

        By default its reward says so: it is `success_reward`, which is 1 unless the task has a rule of its own. A task
        that is paid by its goals asks these (`core.goals.are_goals_met`).
        """
        return self.is_paid(reward)

    def is_paid(self, reward: float) -> bool:
        """Report whether a reward is that of a solved task."""
        return reward >= self.success_reward - ROUNDING

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> Sequence[Margin]:
        """Say how far one world stayed from the limits of the task.

        By default these are those of its goals that are numbers: beside a reward of the task's own, goals are a hint.
        Arguments are as those of `reward`, of one world; ``trace`` is None where the reward reads none.
        """
        return [m for m in goals_margins(self, start, end, trace) if m.has_room]

    def find_warnings(self) -> Iterator[str]:
        """Yield a line for each thing in the scene that its robot can't do, or that is seldom meant.

        Commands say them before anything is tried.
        """
        yield from ()

    def find_goal_faults(self, fixture: Fixture | None) -> Iterator[str]:
        """Yield a line for each reason why the goals can't be reached with what a design brings; None: with nothing.

        By default that is a missing fixture, where all that is to be reached names it, or one that a goal can't use.
        """
        wanted = reaches(self.goals)
        named = [goal for goal in wanted if goal.needs_fixture]
        if fixture is None and wanted and len(named) == len(wanted):
            yield (
                f"the goals of {self.name} name the fixture, and the design has none; add 'fixture', with a pose and "
                "components"
            )
        if fixture is None:
            return

        for goal in self.goals:
            faults = [part.find_fixture_fault(fixture) for part in goal.parts]
            yield from (f"fixture: {fault}" for fault in faults if fault)

    def photographs(self) -> Sequence[Picture]:
        """Return pictures of one's own bench that show this scene, for the prompt.

        Raises:
            UserError: one can't be read.
        """
        return ()

    def reward_in_words(self) -> list[str]:
        """Describe the reward in lines, for a model that can't read it in `source`; none of one in Python."""
        return []

    def source(self) -> str:
        """Return the text of the file that defines the task."""
        return inspect.getsource(sys.modules[type(self).__module__])


NO_CONTEXT: dict[str, Any] = dict.fromkeys(
    (
        "several",
        "description",
        "layout",
        "task_source",
        "goals",
        "vocabulary",
        "helpers",
    ),
    "",
)
"""What a level may say of a task, by the names that templates use; ``several``: such values for each of its parts."""


class Level(ABC):
    """How much a model is told of a task's scene: ``prompt.context=NAME``.

    Attributes:
        numbers: whether texts have numbers of bodies; else pictures show them, and feedback has none either.
        in_words: whether a task needs `Task.in_words`.
        views: names of the pictures that it draws, in their order.
        frame_size: the width and height of pictures of which film strips are made, pixels.
    """

    numbers: ClassVar[bool] = True
    in_words: ClassVar[bool] = True
    views: ClassVar[tuple[str, ...]] = ()
    frame_size: ClassVar[tuple[int, int]] = (320, 240)

    @abstractmethod
    def values(self, task: Task, seed: int) -> dict[str, Any]:
        """Return what is said of a task and the layout of ``seed``: any of `NO_CONTEXT`."""

    def sight(self, task: Task, seed: int) -> Sight:
        """Return what feedback may say of the bodies of the layout of ``seed``."""
        return Sight()

    def report(self, evaluation: Any, task: Task) -> dict[str, Any]:
        """Describe what was observed of a `core.trial.Evaluation`, as JSON, with all numbers; by default nothing.

        Returns:
            ``observed``, a line about the trial that stands for all, and ``details`` of several; each if there is any.
        """
        return {}

    def draw(
        self,
        task: Task,
        seed: int,
        render: Callable[..., Any],
        only: str | Camera = "",
        cut: float | None = None,
    ) -> tuple[Picture, ...]:
        """Draw the layout, where texts have no numbers: all `views`, or ``only`` one of them, or from a camera.

        ``render`` takes ``camera``, ``width`` and ``height``. A parallel view is ``cut`` there, metres along its axis.

        Raises:
            NoPicture: nothing here can draw.
        """
        return ()

    def strip(self, recording: Any, draw: Callable[..., Any], seen: Any) -> Any:
        """Draw a film strip of a rollout, a `core.interfaces.Image`; None: this level shows none.

        Args:
            recording: the `core.interfaces.Recording` of the rollout.
            draw: draws one of its samples (`core.simulation.pictures.Film.draw`).
            seen: the `core.interfaces.Observation` of the rollout; None: nobody observed it.

        Raises:
            NoPicture: nothing here can draw.
        """
        return None


def reward_of(
    task: Task, start: State, end: State, trace: Trace | None = None
) -> Array:
    """Call a task's reward, with the trace if it reads one."""
    if not task.reads_trace:
        return task.reward(start, end)
    return task.reward(start, end, trace)  # type: ignore[call-arg]  # the third is optional, see `Task.reward`


def margins_of(
    task: Task, start: State, end: State, trace: Trace | None, reward: float
) -> tuple[Margin, ...]:
    """Return a task's margins in one world, the least first.

    Where the reward says success, what goals call failed is no limit of the task. Where no margin is left, what the
    reward exceeds success by is the margin.
    """
    own = type(task).margins is not Task.margins
    try:
        margins = least_first(task.margins(start, end, trace))
    except (AttributeError, KeyError, ValueError):
        if own:
            raise
        margins = ()  # goals that don't fit the scene cost the margins, not the rollout

    if task.is_paid(reward):
        margins = tuple(margin for margin in margins if margin.is_kept)
    if margins or own or task.success_reward == 1:
        return margins

    far = 1 - task.success_reward
    return (Margin.at_least("reward", reward, task.success_reward, "", far),)
