"""Define what the rows of a store hold, and check them against their schemas."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import Field as DataclassField
from dataclasses import asdict, dataclass, field, fields
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeVar, cast

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
)
from pydantic import model_validator as check_whole

from core.support.text import clean
from core.trial import Score, Trial, Where
from core.values.efforts import Effort
from core.values.margins import Margin
from core.values.plans import ActionPlan, Waypoints

MAX_BYTES = 100_000_000  # of a text

T = TypeVar("T")

_adapter: Callable[[Any], TypeAdapter[Any]] = lru_cache(maxsize=64)(
    TypeAdapter
)  # slow to make


def dump_plan(plan: ActionPlan) -> str:
    """Write a plan for the column ``waypoints``: literal ones as a list, others with their representation's name."""
    written = plan.dump()
    return json.dumps(
        written
        if isinstance(plan, Waypoints)
        else {"action": plan.action, "plan": written}
    )


def load_plan(text: str) -> list[Any]:
    """Read what `dump_plan` wrote, as an item of ``action_sets``."""
    stored: Any = json.loads(text)
    found: list[Any] = stored["plan"] if isinstance(stored, dict) else stored
    return found


def validated(schema: type[T], value: object) -> T:
    """Return ``value`` as ``schema`` has it.

    Raises:
        ValueError: it does not fit; one line.
    """
    try:
        return cast(T, _adapter(schema).validate_python(value))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        message = first["msg"].removeprefix("Value error, ")
        raise ValueError(clean(f"{where and f'{where}: '}{message}", 300)) from error


def parsed(text: object) -> Any:
    """Read JSON.

    Raises:
        ValueError: it is malformed, or nested too deep.
    """
    if not isinstance(text, str | bytes):
        raise ValueError("is no text")  # noqa: TRY004 - pydantic takes no TypeError
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("is nested too deep") from error


def _named(value: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(value.get("name"), str):
        raise ValueError("has no name")  # noqa: TRY004
    return value


def _with_tie(value: dict[str, Any]) -> dict[str, Any]:
    validated(Amount, value.get("tie", 0.0))
    return value


Json = BeforeValidator(parsed)
Count = Annotated[int, Field(strict=True, ge=0, le=2**53)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**128)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Amount = Annotated[Number, Field(ge=0, le=1e9)]
Distance = Annotated[
    Amount | None, BeforeValidator(lambda value: None if value != value else value)
]  # JSON has nan
Reward = Annotated[Number, Field(ge=0, le=1)]
Id = Annotated[str, Field(max_length=200)]
Chosen = Annotated[dict[str, Any], AfterValidator(_named)]  # a part with its settings
Evolution = Annotated[Chosen, AfterValidator(_with_tie)]


@dataclass(frozen=True)
class Best:
    """The best candidate of a run."""

    reward: Reward
    distance_m: Distance
    generation: Count
    candidate: Id
    margin: Margin | None = None  # the least


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
class Unseen:
    """What the best candidate earned in layouts that the search never saw: in the engine with the lowest mean, and in
    each.
    """

    layouts: Count
    mean: Reward
    worst: Reward
    rewards: tuple[Reward, ...]
    engines: dict[str, tuple[Reward, ...]] = field(
        default_factory=dict
    )  # of runs before they were kept


@dataclass(frozen=True)
class RunFigures:
    """The content of a ``result.json``; ``stopped`` says why a run ended before its budget was spent, ``tie`` up to
    which difference rewards counted as equal.
    """

    task: str
    seed: Seed
    generations: tuple[GenerationFigures, ...]
    n_evaluations: Count
    wall_time_s: Amount
    name: str = ""  # of the method
    robot: str = ""  # of runs before there was a choice
    sim: str = ""
    vlm: str = ""
    tool: str = ""
    material: str = "paper"
    action: str = Waypoints.action
    evolution: str = ""
    fitness: str = ""
    budget: str = ""
    best: Best | None = None
    tie: Amount = 0.0  # of runs before there was one
    stopped: str | None = None
    unseen: Unseen | None = None
    effort: Effort | None = None  # in unseen layouts
    rollouts: Count | None = None  # of runs before they were counted
    versions: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if [generation.index for generation in self.generations] != list(
            range(len(self.generations))
        ):
            raise ValueError("generations are not numbered from 0")
        if self.best is not None and self.best.generation >= len(self.generations):
            raise ValueError(
                f"best.generation is {self.best.generation}, of {len(self.generations)} generations"
            )


@dataclass(frozen=True)
class Details:
    """What the column ``details`` holds of an evaluation: its score, and the numbers of its trials."""

    score: Score
    trials: tuple[Count, ...] = ()
    finals: tuple[Count, ...] = ()


def dump_details(details: Details) -> str:
    """Write the column ``details`` of an evaluation."""
    score = non_default_fields(details.score) | {"reward": details.score.reward}
    return json.dumps(
        {"score": score, "trials": details.trials, "finals": details.finals},
        default=float,
    )


def load_details(text: str) -> Details:
    """Read what `dump_details` wrote.

    Raises:
        ValueError: it is something else.
    """
    return validated(Details, parsed(text))


def trial_row(content: str, trial: Trial) -> dict[str, Any]:
    """Return the columns of a trial of a design's content; ``details`` has what has no column of its own.

    An engine's numbers may be numpy's.
    """
    row = {
        "candidate": trial.candidate,
        "status": trial.status,
        "reward": float(trial.reward),
    }
    details = non_default_fields(trial)
    for name in ("where", *row):
        details.pop(name, None)
    return {
        "content": content,
        **trial.where._asdict(),
        **row,
        "details": json.dumps(details, default=float),
    }


def load_trial(row: Mapping[str, Any] | sqlite3.Row) -> Trial:
    """Read the columns that `trial_row` made.

    Raises:
        ValueError: they hold something else.
    """
    where = [row[name] for name in Where._fields]
    columns = {name: row[name] for name in ("candidate", "status", "reward")}
    return validated(Trial, {**parsed(row["details"]), **columns, "where": where})


def non_default_fields(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass that are not as their defaults, in plain types."""
    written = asdict(value)
    return {
        each.name: written[each.name]
        for each in fields(value)
        if _differs(getattr(value, each.name), each)
    }


def _differs(value: object, field: DataclassField[Any]) -> bool:
    if isinstance(value, dict | tuple) and not value:
        return False
    is_nan = value != value
    return not is_nan and value != field.default


class _Schema(BaseModel):
    model_config = ConfigDict(extra="ignore")


class _Budget(_Schema):
    name: str = ""
    n_agent: Count | None = None
    n_tool: Count | None = None
    n_action: Count | None = None
    n_iteration: Count | None = None
    k_top: Count | None = None
    reward_save: Number | None = None
    stop_reward: float | None = None


class _Config(_Schema):
    name: str = ""
    task: Chosen = {}
    robot: dict[str, Any] = {}
    sim: Chosen = {}
    vlm: Chosen = {}
    tool: Chosen = {}
    material: dict[str, str | float | None] = {}
    evolution: Evolution = {}
    fitness: Chosen = {}
    executor: Chosen = {}
    budget: _Budget = _Budget()
    listener: dict[str, dict[str, Any] | None] = {}
    rollout: dict[str, float | bool | str | dict[str, float] | None] = {}
    seed: Seed = 0


class _Design(_Schema):
    gripper: Annotated[bool, Field(strict=True)]
    strategy_name: str | None = None
    strategy_description: str | None = None
    tool_name: str | None = None
    tool_description: str | None = None


class _Run(_Schema):
    schema_version: Count
    config: Annotated[_Config, Json]
    result: Annotated[RunFigures, Json] | None = None


class _Session(_Schema):
    seconds: Amount
    began: Id
    overrides: Annotated[list[str], Json]
    versions: Annotated[dict[str, str], Json]


class _Request(_Schema):
    id: Id
    generation: Count
    agent: Count
    gripper: Annotated[int, Field(strict=True, ge=0, le=1)]
    temperature: Number
    elites: Annotated[list[Id], Json]
    digest: Id


class _Reply(_Schema):
    request_id: Id
    model: str
    text: str
    error: str | None
    prompt_tokens: Count | None
    completion_tokens: Count | None
    cost_usd: Amount | None
    unanswered: Literal[1] | None = None


class _Strategy(_Schema):
    generation: Count
    agent: Count
    strategy: Count
    parents: Annotated[list[Id], Json]
    design: Annotated[_Design, Json]


class _WrittenPlan(_Schema):
    action: str
    plan: list[Any]


class _Evaluation(_Schema):
    candidate: Id
    generation: Count
    agent: Count
    strategy: Count
    plan: Count
    waypoints: Annotated[list[list[float]] | _WrittenPlan, Json]
    status: Literal["ok", "rejected", "failed"]
    reason: str
    reward: Reward
    distance_m: Amount | None
    content: Id
    details: Annotated[Details, Json]

    @check_whole(mode="after")
    def _fits(self) -> _Evaluation:
        literal = self.waypoints if isinstance(self.waypoints, list) else []
        if self.status == "ok" and {len(waypoint) for waypoint in literal} not in (
            set(),
            {6},
            {7},
        ):
            raise ValueError("waypoints: 6 or 7 numbers are needed in each")
        shown = self.details.score.shown
        if not 0 <= shown < max(len(self.details.trials), 1):
            raise ValueError(f"details: there is no trial {shown} to show")
        return self


class _Trial(_Schema):
    number: Count
    content: Id

    @check_whole(mode="before")
    @classmethod
    def _is_trial(cls, row: dict[str, Any]) -> dict[str, Any]:
        load_trial(row)
        return row


class _Generation(_Schema):
    number: Count
    summary: Annotated[GenerationFigures, Json]


TABLES: dict[str, type[_Schema]] = {
    "run": _Run,
    "sessions": _Session,
    "requests": _Request,
    "replies": _Reply,
    "strategies": _Strategy,
    "evaluations": _Evaluation,
    "trials": _Trial,
    "generations": _Generation,
}
_ORPHANS = (
    "SELECT candidate FROM evaluations LEFT JOIN strategies USING (generation, agent, strategy)"
    " WHERE status = 'ok' AND design IS NULL"
)
_LOST_TRIALS = (
    "SELECT candidate, value FROM evaluations,"
    " (SELECT '$.trials' AS list UNION SELECT '$.finals'), json_each(details, list)"
    " WHERE value NOT IN (SELECT number FROM trials)"
)


def damage(database: sqlite3.Connection) -> str | None:
    """Say what is wrong with a store; None: nothing.

    Raises:
        sqlite3.Error: it can't be read.
    """
    (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        return str(found)
    for table, schema in TABLES.items():
        for row in database.execute(f"SELECT rowid AS at, * FROM {table}"):  # noqa: S608
            try:
                validated(schema, dict(row))
            except ValueError as error:
                return f"row {row['at']} of {table}: {error}"
    for (candidate,) in database.execute(_ORPHANS):
        return f"evaluations: {candidate} has no row in strategies"
    for candidate, number in database.execute(_LOST_TRIALS):
        return f"evaluations: trial {number} of {candidate} has no row in trials"
    return None
