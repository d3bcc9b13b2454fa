"""Define the parts that a plugin can offer, and the data that passes between them and the program.

`core.hooks` says how a plugin offers a part, `core.plugins` finds it. A part is made by calling its factory with the
part's settings as keyword arguments. The names, types and defaults in the factory's signature are what a configuration
may set.
"""

# ruff: noqa: I001 - names that are handed on (`X as X`) stand together

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol, TypeVar, Unpack

import numpy as np
import numpy.typing as npt

from core.design import Budget as Budget, Candidate, DesignError, Tool
from core.errors import UserError
from core.scene import Scene, View as View
from core.task import Task as Task
from core.trial import (
    TIE,
    Condition as Condition,
    Evaluation as Evaluation,
    Score as Score,
    Rewards,
    Trial as Trial,
    Where,
    rewards_by_engine,
)
from core.values.jobs import (
    Ability as Ability,
    Block as Block,
    Checkpoint as Checkpoint,
    Feel as Feel,
    Felt as Felt,
    Looked as Looked,
    Order as Order,
    Outcome as Outcome,
    Passed as Passed,
    Perception as Perception,
    Pushes as Pushes,
    Reactions as Reactions,
    Reading as Reading,
    Recording as Recording,
    RolloutSettings as RolloutSettings,
    World as World,
    Worlds as Worlds,
)
from core.values.materials import PAPER as PAPER, Material as Material
from core.values.printers import MK4 as MK4, Printer as Printer
from core.values.messages import (
    Estimate as Estimate,
    Message as Message,
    Picture as Picture,
    Reply as Reply,
    Spending as Spending,
    Text as Text,
)
from core.values.motions import (
    Begin as Begin,
    JointTrajectory as JointTrajectory,
    Motion as Motion,
)
from core.values.numbers import Numbers as Numbers, Variable
from core.values.observations import Contact as Contact, Observation as Observation
from core.values.plans import (
    ActionPlan as ActionPlan,
    PlannedMotion as PlannedMotion,
    Anchor as Anchor,
    Guard as Guard,
    Judge as Judge,
    Look as Look,
    Sighted as Sighted,
    Seen as Seen,
    Tempo as Tempo,
    Waypoints as Waypoints,
)
from core.values.robots import (
    ISO_9409_1_50 as ISO_9409_1_50,
    Flange as Flange,
    Gripper as Gripper,
    Robot as Robot,
)

Image = npt.NDArray[np.uint8]
JsonObject = dict[str, Any]
"""An object as JSON has it."""

A = TypeVar("A")
B = TypeVar("B")


@dataclass(frozen=True, eq=False)
class Rollout:
    """One job for a simulator.

    It spawns the ``scene`` (None: the task's layout of ``seed``), and the robot with ``tool`` at the trajectory's first
    targets. It lets ``settle_s`` pass, notes the start state, plays the trajectory, holds the last targets for
    ``hold_s``, and notes the end state. With ``record_hz`` > 0 all of it is recorded at that rate, and with ``forces``
    contact forces too. ``reactions`` change the trajectory on the way. There are ``steps_hz`` steps a second or more.
    A job that ``begins`` as another one did goes on from there; one that begins otherwise is played from its start.
    What not every engine can do is an `Ability`.
    """

    tool: Tool
    trajectory: JointTrajectory
    seed: int = 0
    settle_s: float = 0.5
    hold_s: float = 1.0
    record_hz: float = 0.0
    forces: bool = False
    reactions: Reactions | None = None

    scene: Scene | None = None
    steps_hz: float = 0.0
    begins: Checkpoint | None = None


class Simulator(ABC):
    """A physics engine. It takes a batch of jobs and returns as many outcomes. One thread uses it at a time."""

    batch: ClassVar[int] = (
        1  # the best size of a batch; above 1, jobs with different tools are stepped together
    )
    supports: ClassVar[frozenset[Ability]] = frozenset()
    """What it can do that not every engine can. Jobs that need more are refused (`core.simulation.engines`)."""

    drawn_by: str = ""  # the name of what drew the last picture, if the engine has several renderers

    @abstractmethod
    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        """Play each job in a world of its own with `Task.robot`, and return the outcomes in the order of the jobs.

        A job that fails gives an outcome with an error. It raises nothing, and the other jobs are not affected.
        """

    @abstractmethod
    def render(self, task: Task, **view: Unpack[View]) -> Image:
        """Draw a layout and the robot, `Task.robot`, as a picture (height, width, 3) of red, green and blue.

        Raises:
            NoPicture: nothing on this machine can draw (see `core.errors`).
        """

    def stop_at(self, task: Task, job: Rollout, instant: float) -> Checkpoint:
        """Play a job up to an instant of its motion, seconds, for others that begin as it does; see `Ability.FORKS`."""
        raise NotImplementedError("this engine does not go back")

    def world(self, task: Task, tool: Tool, seed: int = 0) -> World:
        """Make a world that the caller steps: the layout of ``seed``, the arm at the task's home, its fingers open.

        An engine may have one world only: the next call of `world` or `rollout` may end this one.

        Raises:
            UserError: this engine plays whole rollouts only.
        """
        raise UserError(
            f"{type(self).__name__} plays whole rollouts only; one that can be stepped is needed"
        )


@dataclass(frozen=True, eq=False)
class Recalled:
    """What a prompt shows of another run, which a person named.

    Attributes:
        kind: ``lesson`` or ``example``.
        source: where it was found, as ``runs/first#3``: the folder, and the number of the lesson or the candidate's id.
        shown: what the prompt shows of it, as JSON.
    """

    kind: str
    source: str
    shown: JsonObject


@dataclass(frozen=True, eq=False)
class Brief:
    """One agent's assignment, as data. An agent is one call of the model, without shared history."""

    task: Task
    scene_seed: int  # the seed of the layout
    representation: ToolRepresentation
    gripper: bool  # ask for attachments to the fingers; else for one rigid tool
    n_tool: int  # tools that are asked for
    n_action: int  # action plans that are asked for with each tool
    generation: int
    agent: int  # its number in the generation
    seed: int  # for a model that draws random numbers
    # The best first; empty: the agent starts from nothing.
    elites: tuple[Evaluation, ...] = ()
    actions: ActionRepresentation = field(kw_only=True)
    # All of earlier generations, if the prompt may show them.
    tried: tuple[Evaluation, ...] = ()
    style: str = ""  # what a strategy adds to the prompt
    # A critic's words, by candidate.
    critiques: Mapping[str, str] = field(default_factory=dict)
    recalled: tuple[Recalled, ...] = ()  # of other runs
    curves: int = 0  # designs of a curve that a design may ask for
    alone: bool = False  # nobody else is asked, and what comes of an answer is told

    @property
    def closes(self) -> bool:
        """Whether waypoints have a grip: of the fingers, or for what a tool grips with."""
        return self.gripper or self.representation.grips


Purpose = Literal["designs", "repairs", "critiques", "lessons", "scenes"]
"""What a model is asked for: designs, once more for those that break a rule, what fails in an elite, what a run taught,
or a scene file."""

OF_DESIGNS: tuple[Purpose, ...] = ("designs", "repairs")
"""The purposes of requests that are answered with designs."""


@dataclass(frozen=True, eq=False)
class Request:
    """One call of the model: the brief, and what was composed from it (messages, JSON schema of the answer).

    Where it asks for no designs, the answer is plain text, and the schema is empty.
    """

    id: str  # for example g0-a3: generation 0, agent 3
    brief: Brief
    messages: tuple[Message, ...]
    schema: JsonObject
    temperature: float
    purpose: Purpose = "designs"
    # Nothing else tells where things are: a model without eyes would guess.
    needs_pictures: bool = False

    @property
    def asks_designs(self) -> bool:
        """Whether the answer has designs, and is not words alone."""
        return self.purpose in OF_DESIGNS


CHARACTERS_PER_TOKEN = 3.0  # English prose has about 4, numbers and URDF fewer
TOKENS_PER_PICTURE = 800  # of 640 x 480 pixels; models differ between some 250 and 800


class VLM(ABC):
    """A vision-language model, or a program that answers in its place.

    A class that implements some of `core.hooks.Events` with ``hookimpl`` receives the events of the run.
    """

    model: str  # the name that is printed and stored with each reply
    takes_schema: bool = False  # it passes on `Request.schema` itself, so that the prompt's text leaves it out
    repairs: bool = False  # it can mend designs that are sent back with their faults
    criticises: bool = True  # it can answer a request for a critique
    sees: bool = True  # it answers what messages and pictures say, and needs no numbers of the scene from the brief

    @classmethod
    def estimate(cls, request: Request, model: str) -> Estimate:
        """Estimate the size and cost of a request. It calls no model and needs no key; here by a rule of thumb."""
        parts = [part for message in request.messages for part in message.parts]
        characters = sum(len(part.text) for part in parts if isinstance(part, Text))
        characters += len(str(request.schema)) if cls.takes_schema else 0
        pictures = sum(isinstance(part, Picture) for part in parts)
        tokens = (
            round(characters / CHARACTERS_PER_TOKEN) + pictures * TOKENS_PER_PICTURE
        )
        rule = f"{CHARACTERS_PER_TOKEN:g} characters to a token, {TOKENS_PER_PICTURE} tokens to a picture"
        return Estimate(tokens, f"rule of thumb: {rule}")

    def share(self, limits: Spending) -> None:  # noqa: B027  # of a model whose calls cost nothing
        """Count what calls cost towards ``limits`` too, which several models share, and make none beyond them.

        Raises:
            UserError: the cost is not known.
        """

    @abstractmethod
    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """Yield one reply for each request, in the order in which they arrive.

        A request that fails gives a reply with an error, never an exception.

        Raises:
            LimitReached: a limit on cost or tokens left requests unanswered; raised after the last reply.
        """


class ToolRepresentation(Variable[Tool], ABC):
    """How a model writes a tool: the fields of a design that describe the tool, and how they are read."""

    robot: (
        Robot  # the arm that tools are for; the program makes a representation for one
    )
    # What a component may be: box, cylinder, capsule, sphere.
    shapes: tuple[str, ...] = ("box",)
    grips: bool = False  # whether components may hold on to what they touch
    material: Material = PAPER  # the program makes it for one, and weighs by it what `parse` and `given` return
    printer: Printer = MK4  # by which tools are made

    @abstractmethod
    def instructions(self, brief: Brief) -> str:
        """Return the part of the prompt that explains the fields and the rules for a tool."""

    @abstractmethod
    def schema(self) -> JsonObject:
        """Return the JSON schema of the fields, as the ``properties`` of an object; all of them are required."""

    @abstractmethod
    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        """Read a tool from the fields of a design. A model wrote them: they may hold anything.

        Raises:
            DesignError: says what is wrong, where, and how to mend it.
        """

    @abstractmethod
    def dump(self, tool: Tool) -> JsonObject:
        """Return the fields that `parse` reads back as the same tool."""

    def abridge(self, tool: Tool) -> JsonObject:
        """Return fields that show an elite's tool in short; `instructions` explains those that the schema lacks."""
        return self.dump(tool)

    def given(self, task: Task) -> Tool | None:
        """Return the tool to use, so that the model is asked for action plans only; None: the model designs tools.

        Raises:
            UserError: there is no tool for this task; names the tasks that have one.
        """
        return None

    def kept(self, task: Task) -> Sequence[Candidate]:
        """Return tools that are there already, each with a plan, which are tried before the model is asked; here none.

        They are of generation 0, and each has an agent's number of its own. One that this task or robot can't take has
        a problem.

        Raises:
            UserError: they can't be read.
        """
        return ()


class ActionRepresentation(Variable[ActionPlan], ABC):
    """How a model writes an action plan, and how that is read.

    With ``guards`` designers may write plans that feel, with ``looks`` plans that look again.
    """

    guards: bool = False
    looks: bool = False

    @abstractmethod
    def instructions(self, brief: Brief) -> str:
        """Return the part of the prompt that says what a plan is: list items in Markdown."""

    @abstractmethod
    def schema(self, *, gripper: bool) -> JsonObject:
        """Return the JSON schema of one plan, for tools with the gripper or without."""

    @abstractmethod
    def parse(self, data: object, *, gripper: bool) -> ActionPlan:
        """Read a plan. A model wrote it: it may hold anything.

        Raises:
            DesignError: says what is wrong, in which waypoint, and how to mend it.
        """

    def dump(self, waypoints: Waypoints) -> list[Any]:
        """Write literal waypoints as a plan, for designers that compute them.

        Raises:
            DesignError: this representation can't write them.
        """
        raise DesignError(
            f"{type(self).__name__} can't write literal waypoints; use action=waypoints"
        )

    def anchor(
        self, waypoints: Waypoints, anchors: Sequence[Anchor], seen: Seen
    ) -> list[Any]:
        """Write the waypoints of one layout as a plan for all: each keeps its place by its anchor.

        There is an anchor for each waypoint. In the layout that was ``seen`` the plan means these waypoints. A
        representation without anchors writes them as they are.

        Raises:
            DesignError: see `dump`; or an anchor is not there, or gives no direction.
        """
        return self.dump(waypoints)


class GivenTools(ToolRepresentation):
    """A representation of given tools: a subclass implements `given` alone."""

    @abstractmethod
    def given(self, task: Task) -> Tool:
        """See `ToolRepresentation.given`."""

    def instructions(self, brief: Brief) -> str:
        return ""

    def schema(self) -> JsonObject:
        return {}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        raise TypeError("a given tool is not parsed")

    def dump(self, tool: Tool) -> JsonObject:
        return {}


class Designer(Protocol):
    """The source of candidates, which the program gives to a strategy (`core.search.designer`)."""

    def design(
        self, generation: int, elites: Sequence[Evaluation] = ()
    ) -> Iterator[Candidate]:
        """Ask the model for a population, with ``elites`` for their offspring, and yield it as replies arrive.

        Candidates that break a rule are among them (`Candidate.problem`). The best elite comes first.
        """


class TriesBeside(Protocol):
    """Tries candidates in conditions beside a search's own, stores the trials, and plays none twice."""

    @property
    def known(self) -> Mapping[tuple[str, Where], Trial]:
        """The trials of the run so far, by the design's content and where it was tried."""

    def try_in(
        self, conditions: Sequence[Condition], candidates: Iterable[Candidate]
    ) -> Iterator[tuple[Candidate, tuple[Trial, ...]]]:
        """Yield each candidate with its trials in all conditions, as they end; no trials where it breaks a rule."""


class EvolutionStrategy(ABC):
    """The search: `ask` gives the candidates of a generation, `tell` takes what they earned.

    Args:
        designer: asks the model for candidates.
        budget: how many candidates and generations the user pays for.
    """

    learns: bool = True  # requests may show what earlier generations earned
    refines: ClassVar[bool] = False  # `evolution.refine` puts it around another one
    # Rewards this close to the best count as equal (`core.trial.best_first`). The program sets it: a run chooses its
    # winner by it, and a strategy may choose its elites by it.
    tie: float = TIE
    trials: TriesBeside | None = None  # of the run; the program sets it

    def __init__(self, designer: Designer, budget: Budget) -> None:
        self.designer = designer
        self.budget = budget

    def write_archive(
        self,
        ranking: Sequence[Evaluation],
        representation: ToolRepresentation,
        folder: Path,
    ) -> None:
        """Write what the strategy found beside the best design, if anything, to ``folder``; it is not there yet.

        ``ranking`` are all candidates that were tried, the best first.
        """
        return  # nothing, unless a strategy has more to give

    def has_generation(self, generation: int, budget: Budget) -> bool:
        """Report whether there is a generation of this number, from 0; by default up to ``budget.n_iteration``."""
        return generation <= budget.n_iteration

    @abstractmethod
    def ask(self) -> Iterator[Candidate]:
        """Yield the candidates of the next generation as they arrive."""

    @abstractmethod
    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Take the evaluations of the whole generation, in the order of `Candidate.key`."""


class Fitness(ABC):
    """A rule: in which conditions a candidate is tried, and what its trials are worth. It plays nothing itself.

    Its factory takes its settings, and ``condition``: the task in the run's engine, in the layout of the run's seed.
    """

    races: bool = False  # its score is the mean reward of the layouts, in the engine where that is the lowest
    finals_check: bool = False  # its `finals` check the winner: they choose no elites, and nearly as much is enough
    tie_by: str = "room"  # decides between those that earn alike: room and then way, or a figure; the program sets it

    @abstractmethod
    def conditions(self) -> Sequence[Condition]:
        """Return the conditions of the search, in the order in which a candidate is tried in them."""

    @abstractmethod
    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        """Make a score of a candidate's trials: one for each condition, in their order.

        Where it `races`, they may be those of some layouts only.
        """

    def finals(self) -> Iterator[Sequence[Condition]]:
        """Yield further layouts, perhaps without end, of each the conditions in all engines.

        They decide between candidates that earn alike. For how long are the search's settings (`Budget.final_s`,
        `Budget.elite_s`). Where they only check (`finals_check`), a reward that is a share `HOLDS` of the search's
        highest loses nothing. Between those that lose as much `core.trial.WHAT_DECIDES` decides, as it does without any
        further layouts.
        """
        return iter(())

    def perturbed(self, conditions: Sequence[Condition]) -> Sequence[Condition]:
        """Return the conditions of a further layout with tool and bodies perturbed; none: nothing perturbs them."""
        return ()

    def unseen(self) -> Sequence[Condition]:
        """Return the conditions of the best candidate at the end, which the search never sees."""
        return ()

    def instructions(self) -> str:
        """Return the part of the prompt that says what a design is judged by; empty: the reward of one rollout."""
        return ""

    def rewards(self, trials: Sequence[Trial]) -> Rewards:
        """Return what a candidate earned in trials of `finals` or `unseen`: by engine a number for each layout."""
        return rewards_by_engine(trials)

    def recombine(self, tried: Sequence[Evaluation]) -> Iterator[Candidate]:
        """Yield candidates made of parts of those that were ``tried``, whose trials are therefore known."""
        return iter(())


CHUNK = 10  # candidates that travel together: the method has as many plans for a tool


class Executor(ABC):
    """Workers that call a picklable function with chunks. As a context manager it ends them.

    **Threads.** One thread calls `map` and reads what it yields; ``chunks`` may be read in another one. `close` may be
    called from any thread, and then `map` ends. The function is called by one thread of a process at a time: a second
    one gets the error `core.errors.SharedByThreads`, which ends the run.

    **Ownership.** The workers are the executor's: they are started when they are needed, and ended by `close`. A worker
    makes its own parts from their names and settings.

    **What may be lost.** A worker that dies costs its chunk alone, whose result is then an exception. A chunk may be
    tried more than once, so the function has no effect but its result.
    """

    @abstractmethod
    def map(
        self, function: Callable[[A], B], chunks: Iterable[A]
    ) -> Iterator[tuple[A, B | Exception]]:
        """Yield each chunk with its result, in the order in which they finish.

        The result is an exception where the function raised one or its worker died. A chunk that has ``pieces``, as a
        run's have, may be tried and yielded piece by piece. ``chunks`` is read no faster than workers need chunks. For
        a function with a ``batch`` above 1 chunks are large, and one worker is enough.
        """

    @abstractmethod
    def close(self) -> None:
        """End the workers at once."""

    def __enter__(self) -> Executor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
