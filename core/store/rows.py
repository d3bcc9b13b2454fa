"""Define what the rows of a store hold, and check them: each class is what one row says, and what a reader gets."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple, NotRequired

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    Json,
    StrictBool,
)
from pydantic_core import from_json
from typing_extensions import TypedDict

from core.config.schemas import RunConfig
from core.design import Candidate
from core.interfaces import OF_DESIGNS, Purpose, Reply
from core.support.inputs import check
from core.trial import (
    Evaluation,
    Making,
    Score,
    Status,
    Tally,
    Trial,
    Where,
    count_rollouts,
)
from core.values.efforts import Effort
from core.values.margins import Margin
from core.values.plans import NO_PLAN
from core.values.torques import TorqueShare

MAX_BYTES = 100_000_000  # of a text
LONGEST = 2_000_000  # characters of a column
LONGEST_REPLY = 2**25

Row = Mapping[str, Any] | sqlite3.Row

Count = Annotated[int, Field(strict=True, ge=0, le=2**53)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Amount = Annotated[Number, Field(ge=0, le=1e9)]
Reward = Annotated[Number, Field(ge=0, le=1)]
Id = Annotated[str, Field(max_length=200)]
Ids = Json[tuple[Id, ...]]
Key = tuple[int, int, int]  # generation, agent and number of a design


def parsed(text: object) -> Any:
    """Read JSON.

    Raises:
        ValueError: it is malformed, or nested too deep.
    """
    if not isinstance(text, str | bytes):
        raise ValueError("is no text")  # noqa: TRY004 - as for all that is no JSON
    return from_json(text)


def _with_usable_parts(config: RunConfig) -> RunConfig:
    """Check what the settings of parts must have for those who read them unresolved."""
    parts = {
        kind: part for kind, part in vars(config).items() if isinstance(part, dict)
    }
    for kind, part in parts.items():
        if kind not in ("robot", "listener") and not isinstance(part.get("name"), str):
            raise ValueError(f"{kind} has no name")
    check(Amount, parts.get("evolution", {}).get("tie", 0.0))
    return config


@dataclass(frozen=True)
class SecondEngineFigures:
    """What the best candidate earned in a second engine, and ``here`` in the same layout in the run's own."""

    engine: Id
    reward: Reward
    here: Reward
    solved: bool = False


@dataclass(frozen=True)
class Best:
    """The best candidate of a run.

    ``solved`` says whether all trials of the search were. ``margin`` is the least; ``reason`` says why it earns
    nothing; ``torque`` is that of the joint that used most of its own. ``measured`` are the means of its figures
    (`core.trial.Figure`), as far as they are known. ``making`` says whether its tool can be made, and ``makeable`` is
    the id of the best candidate whose tool can, where that is another.
    """

    reward: Reward
    generation: Count
    candidate: Id
    solved: bool = False
    margin: Margin | None = None
    reason: str = ""
    torque: TorqueShare | None = None
    second_engine: SecondEngineFigures | None = None
    measured: dict[Id, Number] = field(default_factory=dict)
    making: Making | None = None
    makeable: Id | None = None

    @property
    def distance_m(self) -> float | None:
        """The way of the end-effector's origin; None: it is not known, as of plans that were joined."""
        return self.measured.get("distance_m")


@dataclass(frozen=True)
class GenerationFigures:
    """A generation in ``result.json``; rewards are None where nothing could be tried."""

    index: Count
    best_reward: Reward | None
    mean_reward: Reward | None
    n_candidates: Count
    n_rejected: Count = 0
    n_failed: Count = 0


@dataclass(frozen=True)
class FailedLayout:
    """A trial in which the best candidate failed, why, the numbers drawn for its layout, and its film; empty: none."""

    task: Id
    engine: Id
    layout: Count
    reward: Reward
    cause: str
    draw: dict[str, Number]
    film: str = ""

    @property
    def film_file(self) -> str:
        """Where its film is written, in the run's folder."""
        return f"best/unseen/{self.task}_{self.engine}_{self.layout}.gif"


@dataclass(frozen=True)
class Unseen:
    """What the best candidate earned in layouts that the search never saw: in the engine with the lowest mean, and in
    each; and where it failed, the worst first.
    """

    layouts: Count
    mean: Reward
    worst: Reward
    rewards: tuple[Reward, ...]
    engines: dict[str, tuple[Reward, ...]]
    failed: tuple[FailedLayout, ...] = ()


@dataclass(frozen=True)
class HeldFigures:
    """In how many layouts the best candidate held, and below what its chance of failure is, at 95 %."""

    held: Count
    layouts: Count
    fails_below: Reward


@dataclass(frozen=True)
class RunFigures:
    """The content of a ``result.json``.

    Attributes:
        name: of the method; with ``budget``, ``material`` and the names of the parts as configured.
        effort: of the best candidate, in unseen layouts.
        finalists: what each earned in further layouts, by engine.
        held: in how many layouts more the best candidate held; None: it was tried in none.
        perturbed: in how many with tool and bodies perturbed.
        tie: the difference up to which rewards counted as equal.
        stopped: why the run ended before its budget was spent; None: it did not.
    """

    name: str
    task: str
    robot: str
    sim: str
    vlm: str
    tool: str
    action: str
    evolution: str
    fitness: str
    material: str
    budget: str
    seed: Count
    best: Best | None
    unseen: Unseen | None
    effort: Effort | None
    finalists: dict[str, dict[str, tuple[Reward, ...]]]
    held: HeldFigures | None
    perturbed: HeldFigures | None
    tie: Amount
    stopped: str | None
    generations: tuple[GenerationFigures, ...]
    n_evaluations: Count
    rollouts: Count
    wall_time_s: Amount
    rollouts_per_s: Amount
    versions: dict[str, str]

    def __post_init__(self) -> None:
        numbers = [generation.index for generation in self.generations]
        if numbers != list(range(len(numbers))):
            raise ValueError("generations are not numbered from 0")
        if self.best is not None and self.best.generation >= len(numbers):
            raise ValueError(
                f"best.generation is {self.best.generation}, of {len(numbers)} generations"
            )


@dataclass(frozen=True)
class Details:
    """What the column ``details`` holds of an evaluation: its score, and the numbers of its trials."""

    score: Score
    trials: tuple[Count, ...]
    finals: tuple[Count, ...]

    def __post_init__(self) -> None:
        shown = self.score.shown
        if not 0 <= shown < max(len(self.trials), 1):
            raise ValueError(f"there is no trial {shown} to show")


@dataclass(frozen=True)
class StoredConfig:
    """The row of the run itself; ``result`` is None until it has ended."""

    schema_version: Count
    config: Json[Annotated[RunConfig, AfterValidator(_with_usable_parts)]]
    result: Json[RunFigures] | None


@dataclass(frozen=True)
class StoredSession:
    """A start of the run, or a resume."""

    seconds: Amount
    versions: Json[dict[str, str]]


@dataclass(frozen=True)
class StoredReply(Reply):
    """A reply, within the bounds that figures rely on."""

    prompt_tokens: Count | None = None
    completion_tokens: Count | None = None
    cost_usd: Amount | None = None
    cached_tokens: Count | None = None
    saved_usd: Number | None = None


class ShownSource(NamedTuple):
    """What a request showed of another run: its kind, ``lesson`` or ``example``, and where it was found."""

    kind: Id
    source: Annotated[str, Field(max_length=5000)]  # with a path


@dataclass(frozen=True)
class StoredRequest:
    """A request with the ids of its elites, and its reply; None: none came."""

    id: Id
    generation: Count
    agent: Count
    gripper: Literal[0, 1]
    temperature: Number
    elites: Ids
    digest: Id
    purpose: Purpose = "designs"
    recalled: Json[tuple[ShownSource, ...]] = ()
    reply: Reply | None = None

    @property
    def asks_designs(self) -> bool:
        """Whether its answer has designs, and is not words alone."""
        return self.purpose in OF_DESIGNS


class WrittenDesign(TypedDict):
    """A design as a model wrote it, without its plans; it has the fields of its tool representation too."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    gripper: StrictBool
    strategy_name: NotRequired[str | None]
    strategy_description: NotRequired[str | None]
    tool_name: NotRequired[str | None]
    tool_description: NotRequired[str | None]


@dataclass(frozen=True)
class StoredDesign:
    """A design, and the ids of the candidates that it derives from."""

    generation: Count
    agent: Count
    design: Count
    parents: Ids
    fields: Annotated[Json[WrittenDesign], Field(alias="written")]

    @property
    def key(self) -> Key:
        return self.generation, self.agent, self.design

    @property
    def written(self) -> dict[str, Any]:
        return dict(self.fields)


class WrittenPlan(TypedDict):
    """A plan that is no list of poses: the name of its representation, and what that wrote."""

    action: str
    plan: list[Any]


Pose = Annotated[list[float], Field(min_length=6, max_length=7)]


@dataclass(frozen=True, eq=False)
class StoredEvaluation:
    """What a candidate earned; ``number`` is that of its plan. The reader adds the trials that ``details`` names."""

    candidate: Id
    generation: Count
    agent: Count
    design: Count
    number: Annotated[Count, Field(alias="plan")]
    waypoints: Json[list[Pose] | WrittenPlan]
    status: Status
    reason: str
    reward: Reward
    distance_m: Amount | None
    content: Id
    details: Json[Details]
    trials: tuple[Trial, ...] = ()
    finals: tuple[Trial, ...] = ()

    @property
    def design_key(self) -> Key:
        """The key of its design."""
        return self.generation, self.agent, self.design

    @property
    def plan(self) -> list[Any]:
        """The plan as written: an item of ``action_sets``."""
        written = self.waypoints
        return written["plan"] if isinstance(written, dict) else written

    @property
    def score(self) -> Score:
        return self.details.score

    @property
    def rollouts(self) -> int:
        """The number of rollouts that were played for it."""
        return count_rollouts(self.candidate, self.trials)

    def of(self, candidate: Candidate) -> Evaluation:
        """Return it as the evaluation of a candidate that was read again."""
        finals = Tally.of_trials(self.finals)
        return Evaluation(candidate, self.trials, self.score, finals)

    def unread(self) -> Evaluation:
        """Return it as the evaluation of a candidate of the same numbers, whose design is not read."""
        problem = self.reason if self.status == "rejected" else None
        candidate = Candidate(
            None, NO_PLAN, *self.design_key, action=self.number, problem=problem
        )
        return self.of(candidate)


@dataclass(frozen=True)
class StoredTrial:
    """A trial of a design's content."""

    number: int
    content: str
    trial: Trial


_TRIAL_FIELDS = {known.name for known in fields(Trial)} - {"measured"}


def load_trial(row: Row) -> Trial:
    """Read the row of a trial. What has no column of its own is in ``details``: further fields, and what was measured.

    Raises:
        ValueError: they hold something else.
    """
    where = [row[name] for name in Where._fields]
    columns = {name: row[name] for name in ("candidate", "status", "reward")}
    details = {**parsed(row["details"])}
    names = [name for name in details if name not in _TRIAL_FIELDS]
    details["measured"] = {name: details.pop(name) for name in names}
    return check(Trial, {**details, **columns, "where": where})


TABLES: dict[str, Callable[[Any], object]] = {
    "run": partial(check, StoredConfig),
    "sessions": partial(check, StoredSession),
    "requests": partial(check, StoredRequest),
    "replies": partial(check, StoredReply),
    "designs": partial(check, StoredDesign),
    "evaluations": partial(check, StoredEvaluation),
    "trials": load_trial,
}
"""How a row of each table is read."""


def check_row(table: str, row: Row) -> Any:
    """Check that readers take a row of a table, and return what they get.

    Raises:
        ValueError: they don't; one line.
    """
    columns = dict(row)
    for name, value in columns.items():
        most = LONGEST_REPLY if name == "text" else LONGEST
        if isinstance(value, str | bytes) and len(value) > most:
            raise ValueError(
                f"{name}: has {len(value):,} characters, of at most {most:,}"
            )
    return TABLES[table](columns)
