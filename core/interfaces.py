"""The parts that a plugin can be. Each is small; `core.hooks` says how one is offered, `core.plugins` how one is found.

A part is made by calling what its plugin registered with the part's settings as keyword arguments: their names, types
and defaults in that signature are what the configuration may set.
"""

from __future__ import annotations

import inspect
import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from core.design import TIE, Candidate, Evaluation, Tool
from core.errors import UsageError, UserError
from core.geometry import Array, Pose
from core.jobs import JointTrajectory, Outcome, Recording, Rollout, RolloutSettings, World
from core.scene import Camera, Goal, Scene, State

Image = npt.NDArray[np.uint8]
A = TypeVar("A")
B = TypeVar("B")


# --- the task ---------------------------------------------------------------------------------------------------


class Task(ABC):
    """A manipulation task: a scene, a goal, and a reward. Its source file is shown to the model as it stands."""

    name: ClassVar[str]
    description: ClassVar[str]  # one paragraph, for the model
    goals: ClassVar[tuple[Goal, ...]]  # the same for programs; several: any one of them is enough
    home: ClassVar[Pose] = Pose(np.array([0.5, 0.0, 0.5]))  # the end-effector's, at spawn
    camera: ClassVar[Camera] = Camera()
    success_reward: ClassVar[float] = 0.95

    @abstractmethod
    def scene(self, seed: int) -> Scene:
        """What stands in the world. The same seed gives the same layout; only random layouts look at it."""

    @abstractmethod
    def reward(self, start: State, end: State) -> Array:
        """In [0, 1], for one world or many: states (..., B, 3) in, (...) out. ``start`` is after settling, before the
        motion.
        """

    def source(self) -> str:
        """The text of the file that defines the task."""
        return inspect.getsource(sys.modules[type(self).__module__])


# --- the simulator ----------------------------------------------------------------------------------------------


class Simulator(ABC):
    """A physics engine. Batch first: many jobs in, as many outcomes out, in order. One thread uses it at a time."""

    batch: ClassVar[int] = 1  # jobs it likes at once; more than one: it steps them together, whatever their tools
    drawn_by: str = ""  # what drew the last picture, for people, where an engine has more than one way

    @abstractmethod
    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        """Try each job in a world of its own. A job that breaks gives an outcome with an error; its neighbours are
        unharmed.
        """

    @abstractmethod
    def render(
        self,
        task: Task,
        *,
        seed: int = 0,
        tool: Tool | None = None,
        arm: Array | None = None,
        fingers: Array | None = None,
        state: State | None = None,
        camera: Camera | None = None,
        width: int = 640,
        height: int = 480,
    ) -> Image:
        """A picture (height, width, 3) of the scene and the robot; what is left out is as at spawn.

        Raises:
            NoPicture: nothing here can draw one (see `core.errors`).
        """

    def world(self, task: Task, tool: Tool, seed: int = 0) -> World:
        """A world to be stepped from outside: the scene of ``seed``, and the arm at the task's home with its fingers
        open. An engine may keep one only: the next world or rollout ends it.

        Raises:
            UserError: this engine plays whole rollouts only.
        """
        raise UserError(f"{type(self).__name__} plays whole rollouts only; one that can be stepped is needed")


# --- the model --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Brief:
    """What an agent is asked, for programs. ``elites`` (best first) are there for an evolution request, else empty."""

    task: Task
    scene_seed: int
    representation: ToolRepresentation
    gripper: bool
    n_tool: int
    n_action: int
    generation: int
    agent: int
    seed: int
    elites: tuple[Evaluation, ...] = ()


@dataclass(frozen=True)
class Text:
    text: str


@dataclass(frozen=True)
class Picture:
    """A PNG file's bytes. ``name`` is how the file is called where a request is kept."""

    png: bytes
    name: str = "scene"


@dataclass(frozen=True)
class Message:
    role: Literal["system", "user", "assistant"]
    parts: tuple[Text | Picture, ...]


@dataclass(frozen=True, eq=False)
class Request:
    """One call of the model: the brief, and what was rendered from it (messages, JSON schema of the answer)."""

    id: str
    brief: Brief
    messages: tuple[Message, ...]
    schema: dict[str, Any]
    temperature: float


@dataclass(frozen=True)
class Reply:
    """What came back for a request: the raw text, or ``error``. Token counts and cost are None where nobody knows."""

    request_id: str
    text: str
    model: str
    error: str | None = None
    prompt_tokens: int | None = None
    completion_tokens: int | None = None
    cost_usd: float | None = None


@dataclass(frozen=True)
class Estimate:
    """What a request is reckoned to take before anybody is asked: tokens of its messages, US dollars per token in and
    out (None: nobody knows), and where the figures are from.
    """

    prompt_tokens: int
    counted_by: str
    usd_per_prompt_token: float | None = None
    usd_per_completion_token: float | None = None
    priced_by: str | None = None


CHARACTERS_PER_TOKEN = 3.0  # English prose has about 4, numbers and URDF fewer
TOKENS_PER_PICTURE = 800  # of 640 x 480 pixels; models differ between some 250 and 800


class VLM(ABC):
    """A vision-language model, or what answers in its place.

    One that implements some of `core.hooks.Events` with ``hookimpl`` hears what happens in the run.
    """

    model: str  # as shown to people and kept with each reply

    @classmethod
    def estimate(cls, request: Request, model: str) -> Estimate:
        """Without asking anybody, hence without a key. Here by a rule of thumb, whatever the model."""
        parts = [part for message in request.messages for part in message.parts]
        characters = sum(len(part.text) for part in parts if isinstance(part, Text))
        pictures = sum(isinstance(part, Picture) for part in parts)
        tokens = round(characters / CHARACTERS_PER_TOKEN) + pictures * TOKENS_PER_PICTURE
        rule = f"{CHARACTERS_PER_TOKEN:g} characters to a token, {TOKENS_PER_PICTURE} tokens to a picture"
        return Estimate(tokens, f"rule of thumb: {rule}")

    @abstractmethod
    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """One reply per request, as they arrive. A request that fails gives a reply with an error, never an
        exception.

        Raises:
            LimitReached: after the replies that there are, if what may be spent is spent and requests are left.
        """


class ToolRepresentation(ABC):
    """How a model writes a tool down, and how it is read: the fields of a strategy that say what the tool is."""

    @abstractmethod
    def instructions(self, brief: Brief) -> str:
        """Its part of the prompt: the rules a tool must keep."""

    @abstractmethod
    def schema(self) -> dict[str, Any]:
        """JSON schema of its fields, as the ``properties`` of an object; all are required."""

    @abstractmethod
    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        """Read a strategy's fields, which nobody has checked.

        Raises:
            DesignError: what is wrong, where, and how to mend it.
        """

    @abstractmethod
    def dump(self, tool: Tool) -> dict[str, Any]:
        """The fields that `parse` reads back as the same tool."""

    def given(self, task: Task) -> Tool | None:
        """The tool that is there already, so that only action plans are asked for; None: tools are designed.

        Raises:
            UserError: there is none for this task; says for which there are.
        """
        return None


class GivenTools(ToolRepresentation):
    """Tools that are there already: nothing is asked about them, nothing is written, nothing is read."""

    @abstractmethod
    def given(self, task: Task) -> Tool: ...

    def instructions(self, brief: Brief) -> str:
        return ""

    def schema(self) -> dict[str, Any]:
        return {}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        raise TypeError("a given tool is not parsed")

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {}


# --- the search -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Budget:
    """How much is tried, and what survives (the paper's parameters)."""

    n_agent: int
    n_tool: int
    n_action: int
    n_iteration: int
    k_top: int
    reward_save: float
    stop_reward: float | None = None

    @property
    def population(self) -> int:
        """Candidates per generation."""
        return self.n_agent * self.n_tool * self.n_action


class Designer(Protocol):
    """Where candidates come from; `core.search.designer` has the one there is."""

    def design(self, generation: int, elites: Sequence[Evaluation] = ()) -> Iterator[Candidate]:
        """A population: a fresh sampling, or with elites their offspring. Candidates come as replies arrive, the ones
        that break a rule among them (`Candidate.problem`).
        """
        ...


class EvolutionStrategy(ABC):
    """The search: `ask` gives the candidates of a generation, `tell` takes what they earned.

    Args:
        designer: asks the model for candidates.
        budget: how many candidates and generations the user pays for.
        tie: rewards this close to the best count as equal, and the shorter distance goes first
            (`core.design.ranked`). The run chooses its winner by it; a strategy may choose its elites by it.

    Raises:
        UsageError: ``tie`` is negative or not finite.
    """

    tie: float = TIE

    def __init__(self, designer: Designer, budget: Budget, tie: float = TIE) -> None:
        if not 0 <= tie < math.inf:
            raise UsageError(f"evolution.tie must be 0 or greater, got {tie}")
        self.designer = designer
        self.budget = budget
        self.tie = tie

    @abstractmethod
    def ask(self) -> Iterator[Candidate]:
        """The next generation's candidates, as they come."""

    @abstractmethod
    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """What the whole generation earned, in the order of `Candidate.key`."""


class Evaluate(Protocol):
    """Candidates in, their evaluations out, in order. ``batch`` is how many candidates it takes at once; more than one
    means that they need not share a tool.
    """

    @property
    def batch(self) -> int: ...

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]: ...


class Fitness(ABC):
    """Decide what a candidate's rollouts are worth. It is picklable, and called in workers.

    Besides its settings the factory is given ``evaluator``, which tries candidates in the chosen engine (a
    `core.simulation.rollout.Evaluator`).
    """

    @property
    def batch(self) -> int:
        """Candidates that it takes at once; with 1 they come grouped by tool."""
        return 1

    @abstractmethod
    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        """One evaluation for each candidate, in order."""


# --- the machine ------------------------------------------------------------------------------------------------


class Executor(ABC):
    """Runs a picklable function over chunks, somewhere. A context manager: leaving it ends its workers."""

    @abstractmethod
    def map(self, function: Callable[[A], B], chunks: Iterable[A]) -> Iterator[tuple[A, B | Exception]]:
        """Each chunk with its result, as they finish; with an exception where the function raised or its worker died.
        ``chunks`` is read no faster than workers need them. A function with a ``batch`` greater than 1 takes large
        chunks, and one worker is as fast as many.
        """

    @abstractmethod
    def close(self) -> None:
        """Ends the workers, at once."""

    def __enter__(self) -> Executor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


__all__ = [
    "CHARACTERS_PER_TOKEN",
    "TOKENS_PER_PICTURE",
    "VLM",
    "Brief",
    "Budget",
    "Designer",
    "Estimate",
    "Evaluate",
    "EvolutionStrategy",
    "Executor",
    "Fitness",
    "GivenTools",
    "Image",
    "JointTrajectory",
    "Message",
    "Outcome",
    "Picture",
    "Recording",
    "Reply",
    "Request",
    "Rollout",
    "RolloutSettings",
    "Simulator",
    "Task",
    "Text",
    "ToolRepresentation",
    "World",
]
