"""Climb one family of scenes with one seed, level by level."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from core.errors import UserError
from core.support.cli import say
from core.support.templates import macros
from core.values.efforts import holds
from plugins.results.pages.runs import FinishedRun
from plugins.results.study.ladder.admission import Admission, admit, share
from plugins.results.study.running import Runner
from plugins.results.study.study_files import StudyRun, read_state

MOST_DRAWS = 4  # seeds that are tried, until a level has no rung
FAILURES = 2  # levels in a row after which nobody climbs on
BUDGET = (
    "budget.n_agent=2",
    "budget.n_tool=2",
    "budget.n_action=1",
    "budget.n_iteration=0",
    "budget.elite_s=0",
    "budget.final_s=0",
)
"""Few candidates, so that a level takes about 40 rollouts in layouts that no search saw, and half as many before."""

QUIET = ("film=false", "listener=[]", "second=[]")

_playing = threading.Lock()


@dataclass(frozen=True)
class Step:
    """What became of one level.

    Attributes:
        family, level, seed: of the staircase.
        drawn: the seed of the scene; None: none of those that were drawn counts.
        held: whether the design holds in each engine.
        shares: of the unseen layouts in which it does, by engine; empty: there is no design.
        requests: to the model.
        tokens: of prompts and answers together; None: not known.
        rollouts: of the search, and of its end.
        seconds: of the run.
        remark: why there is no rung or no design.
    """

    family: str
    level: int
    seed: int
    drawn: int | None
    held: bool = False
    shares: tuple[tuple[str, float], ...] = ()
    requests: int = 0
    tokens: int | None = None
    rollouts: int = 0
    seconds: float = 0.0
    remark: str = ""

    def __str__(self) -> str:
        return str(macros("plugins.results", "words").step(self))


@dataclass(frozen=True)
class Staircase:
    """The levels of a family for one seed, as one method climbs them.

    Attributes:
        family: of scenes.
        seed: counts from 0.
        seeds: how many there are, so that none draws the scenes of another.
        method: its name.
        folder: of all results.
        words: of ``core.run``, for all levels.
        most: the last level that is tried.
    """

    family: str
    seed: int
    seeds: int
    method: str
    folder: Path
    words: tuple[str, ...]
    most: int

    def climb(self, runner: Runner) -> Iterator[Step]:
        """Climb until two levels in a row fail, and say what became of each; what is there already is not run again.

        Raises:
            UserError: a run did not come to its end.
        """
        failed = 0
        for level in range(1, self.most + 1):
            drawn, remark = self._draw(level)
            if drawn is None:
                step = Step(self.family, level, self.seed, None, remark=remark)
            else:
                step = self._run(level, drawn, runner)

            say(str(step), file=sys.stderr)
            yield step
            failed = 0 if step.held else failed + 1
            if drawn is None or failed >= FAILURES:
                return

    def _draw(self, level: int) -> tuple[int | None, str]:
        """Return the seed of the first scene that counts, or why none of several does."""
        remark = ""
        for number in range(MOST_DRAWS):
            drawn = self.seed + number * self.seeds
            found = self._admit(level, drawn)
            if not found.refused:
                return drawn, ""
            remark = found.refused

        return None, remark

    def _admit(self, level: int, drawn: int) -> Admission:
        file = self.folder / "rungs" / f"{self.family}_{level}_seed{drawn}.json"
        chosen = ("robot", "rollout", "executor", "protocol.")
        words = [
            *self._scene(level, drawn),
            *("tool=boxes", "designs=none", "fitness.layouts=20"),
            "fitness.sims=${protocol.engines}",
            *(word for word in self.words if word.startswith(chosen)),
        ]
        with _playing:  # one at a time: each uses all workers
            return admit(words, file)

    def _scene(self, level: int, drawn: int) -> list[str]:
        return [
            "protocol=ladder",
            "task=ladder",
            f"task.family={self.family}",
            f"task.level={level}",
            f"task.seed={drawn}",
        ]

    def _run(self, level: int, drawn: int, runner: Runner) -> Step:
        place = f"{self.method}/{self.family}/seed{self.seed}/level{level}"
        words = (
            *self._scene(level, drawn),
            f"seed={self.seed}",
            f"name={self.method}",
            *self.words,
        )
        name = f"{self.family} level {level}"
        run = StudyRun(self.method, name, self.seed, self.folder / place, words)
        problem = runner.finish(run)
        if problem is None:
            raise UserError(f"{run} was not begun")
        if problem:
            raise UserError(f"{run}: {problem}")

        return self._read(level, drawn, run)

    def _read(self, level: int, drawn: int, run: StudyRun) -> Step:
        """Say what became of a run that is at its end."""
        state = read_state(run)
        if not isinstance(state, FinishedRun):
            remark = state.reason if state is not None else "nothing is there"
            return Step(self.family, level, self.seed, drawn, remark=remark)

        unseen = state.figures.unseen
        engines = unseen.engines if unseen is not None else {}
        shares = {engine: share(rewards) for engine, rewards in engines.items()}
        replies = [reply for _, reply in state.store.answers()]
        told = [
            reply.prompt_tokens + reply.completion_tokens
            for reply in replies
            if reply.prompt_tokens is not None and reply.completion_tokens is not None
        ]
        played = state.rollouts + sum(map(len, engines.values()))
        return Step(
            self.family,
            level,
            self.seed,
            drawn,
            held=bool(shares) and all(map(holds, shares.values())),
            shares=tuple(shares.items()),
            requests=len(replies),
            tokens=sum(told) if told else None,
            rollouts=played,
            seconds=state.figures.wall_time_s,
        )


def highest(steps: list[Step]) -> int:
    """Return the highest level at which a design held; 0: at none."""
    return max((step.level for step in steps if step.held), default=0)
