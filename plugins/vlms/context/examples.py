"""Choose winners of other runs for a prompt: tools and plans of tasks that are alike."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from omegaconf import OmegaConf

from core.config.compose import task_part
from core.config.gate import take_stored
from core.design import DesignError, Tool
from core.designs.prompt_values import RunFacts
from core.errors import UserError
from core.interfaces import (
    Brief,
    Evaluation,
    JsonObject,
    Recalled,
    Task,
    ToolRepresentation,
)
from core.search.saved_designs import read_stored
from core.store.reader import StoredRun
from core.store.rows import StoredEvaluation
from plugins.vlms.context.elites import describe_design, round_numbers
from plugins.vlms.context.lessons import dump_recalled, words_of

EXAMPLE = "example"  # a kind of what is recalled
MOST_TASKS = 2
LONGEST = 12_000  # characters of an example


@dataclass(frozen=True, eq=False)
class Winner:
    """The best candidate of a finished run.

    Attributes:
        run: the folder, as it was named.
        task: of the run.
        context: the level at which the run was told of its scene.
        best: what it earned, read again by the representation that prompts ask for.
    """

    run: str
    task: Task
    context: str
    best: Evaluation

    def dump(self, representation: ToolRepresentation) -> JsonObject:
        """Write what a prompt shows of it: the task's name and the reward, the tool in short, and the plan."""
        entry = describe_design(self.best, representation)
        del entry["id"]  # it is none of this run's candidates

        plan = round_numbers(self.best.candidate.plan.dump())
        return {"task": self.task.name, **entry, "action_plan": plan}


def examples_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write the winners that a request recalls as JSON for templates, their ``examples``; empty: there are none.

    Args:
        brief: with what is recalled.
        mounted: the tool on the arm, which this says nothing of.
        facts: of the run.
    """
    return dump_recalled(brief, EXAMPLE).replace("```", "'''")


def recall_examples(
    task: Task, representation: ToolRepresentation, facts: RunFacts
) -> list[Recalled]:
    """Read the winners of the runs that the settings name, and choose those of `MOST_TASKS` tasks that are alike.

    A plan has numbers of its scene. Where prompts tell no numbers, a run counts only if it was told as little.

    Args:
        task: what prompts are for.
        representation: reads the tools, and writes them for prompts.
        facts: of the run: the folders, and the level at which bodies are described.

    Raises:
        UserError: a folder holds no finished run, or this run's representation can't read its winner.
    """
    settings = facts.settings
    winners = [read_winner(folder, representation) for folder in settings.examples]
    allowed = [
        winner
        for winner in winners
        if facts.level.numbers or winner.context == settings.context
    ]

    recalled = []
    for winner in choose_winners(allowed, task):
        shown = winner.dump(representation)
        length = len(json.dumps(shown))
        if length > LONGEST:
            raise UserError(
                f"prompt.examples: the winner of {winner.run} takes {length} characters, more than {LONGEST}; leave "
                "this run away"
            )
        source = f"{winner.run}#{winner.best.candidate.id}"
        recalled.append(Recalled(EXAMPLE, source, shown))

    return recalled


def read_winner(folder: str, representation: ToolRepresentation) -> Winner:
    """Read the best candidate of the run in a folder.

    Raises:
        UserError: there is no finished run, or its winner can't be read by ``representation``.
    """
    where = f"prompt.examples: {folder}"
    store = StoredRun(Path(folder))
    try:
        config, _ = take_stored(store.config(), Path(folder), kinds=["task", "robot"])
        task = task_part(OmegaConf.create(config)).create()
        winner = _find_winner(store)
        design = store.designs()[winner.design_key]
        (found,) = read_stored(design, [winner], representation, task)
    except (UserError, DesignError) as error:
        raise UserError(f"{where}: {error}") from error

    if found.problem is not None or found.tool is None:
        raise UserError(
            f"{where}: this run's tool=... can't read its winner: {found.problem}"
        )

    context = config.get("prompt", {}).get("context", "")
    return Winner(folder, task, str(context), winner.of(found))


def _find_winner(store: StoredRun) -> StoredEvaluation:
    """Find the evaluation of a run's best candidate.

    Raises:
        UserError: the run has not ended, found nothing, or does not hold it.
    """
    result = store.result()
    if result is None or result.best is None:
        raise UserError("the run has no best candidate; give a finished one")

    name = result.best.candidate
    for stored in store.evaluations():
        if stored.candidate == name:
            return stored

    raise UserError(f"its best candidate {name} is not stored")


def choose_winners(winners: list[Winner], task: Task) -> list[Winner]:
    """Choose the best winners of the `MOST_TASKS` tasks that share most words with a task.

    A task that shares none is left out.
    """
    best: dict[str, Winner] = {}
    for winner in sorted(winners, key=lambda winner: -winner.best.reward):
        best.setdefault(winner.task.name, winner)

    wanted = words_of(task)
    shared = {
        name: len(words_of(winner.task) & wanted) for name, winner in best.items()
    }
    alike = sorted(
        (name for name in best if shared[name]), key=lambda name: -shared[name]
    )

    return [best[name] for name in alike[:MOST_TASKS]]
