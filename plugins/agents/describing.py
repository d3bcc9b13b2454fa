"""Say what became of candidates, at the level of ``prompt.context``: what prompts would say of elites, and no more."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.designs.reading import dump_design
from core.interfaces import Brief, Evaluation, Trial
from core.plugins import installed
from core.simulation.measuring import BEGINS_S
from core.simulation.rehearsing import Rehearsal
from core.support.templates import fill
from core.support.text import number, short_numbers
from core.trial import Where

_PLAN = "action_plan"
_DIFFERS = 0.1  # of a reward in two engines


@dataclass(frozen=True, eq=False)
class Describer:
    """Describes to an agent what came of candidates.

    Attributes:
        facts: what prompts may say of the run.
        brief: names the task, the layout and the representation.
    """

    facts: RunFacts
    brief: Brief

    def clean(self, text: str) -> str:
        """Return a text without what this level does not say."""
        brief = self.brief
        return self.facts.level.sight(brief.task, brief.scene_seed).text(text)

    def describe(self, evaluation: Evaluation) -> dict[str, Any]:
        """Describe what came of a candidate, as JSON, without its design, which the agent has."""
        entry = self.describe_whole(evaluation)
        candidate = evaluation.candidate
        if candidate.tool is None:
            return entry

        representation = self.brief.representation
        design = dump_design(candidate, representation)
        design |= representation.abridge(candidate.tool)
        known = {*design, _PLAN}
        return {key: value for key, value in entry.items() if key not in known}

    def describe_whole(self, evaluation: Evaluation) -> dict[str, Any]:
        """Describe a candidate as prompts describe an elite, as JSON, with why it earned nothing or was not played."""
        candidate = evaluation.candidate
        entry: dict[str, Any] = {
            "id": candidate.id,
            "reward": float(number(evaluation.reward, 4)),
            "solved": evaluation.solved,
        }
        if evaluation.status != "ok":
            entry["status"] = evaluation.status
        if evaluation.reason:
            entry["reason"] = self.clean(evaluation.reason)
        if candidate.tool is None:
            return entry

        compute = installed().factory("prompt_value", "elites")
        brief = replace(self.brief, elites=(evaluation,))
        (elite,) = json.loads(compute(brief, Tool(gripper=brief.gripper), self.facts))
        return {**elite, **entry}

    def describe_beginnings(self, evaluation: Evaluation) -> list[str]:
        """Say of trials that were to go on from an earlier one from when on they were played, a line each."""
        fork = evaluation.candidate.fork
        if fork is None:
            return []

        lines = []
        for trial in evaluation.trials:
            from_s = trial.measured.get(BEGINS_S, 0.0)
            if from_s:
                said = f"went on from waypoint {fork.waypoint} of {fork.candidate.id}, at {from_s:.2f} s"
                said += f" of {trial.motion_s:.2f} s"
            else:
                said = (
                    f"played from the start: {trial.engine} can't go on from a stored state, or the plan differs from "
                    f"{fork.candidate.id} before it rests at waypoint {fork.waypoint}"
                )
            lines.append(f"layout {trial.layout}: {said}")
        return lines

    def compare_engines(
        self, evaluation: Evaluation, known: Mapping[tuple[str, Where], Trial]
    ) -> list[str]:
        """Say what a candidate's trials earned elsewhere, in the same layouts in other engines, a line each."""
        lines = []
        for trial in evaluation.trials:
            content = evaluation.candidate.of(trial.task).content
            others = {
                where.engine: other.reward
                for (tried, where), other in known.items()
                if tried == content
                and where._replace(engine=trial.engine) == trial.where
            }
            others.pop(trial.engine, None)
            for engine, reward in sorted(others.items()):
                line = f"layout {trial.layout}: {trial.reward:.3f} in {trial.engine}, {reward:.3f} in {engine}"
                if abs(trial.reward - reward) > _DIFFERS:
                    line += ": they differ, and one of the two may be wrong"
                lines.append(line)
        return lines

    def describe_curve(self, evaluations: Sequence[Evaluation]) -> str:
        """Say what came of the designs of a curve, in the order of what was added, and name the best."""
        compute = installed().factory("prompt_value", "ledger")
        brief = replace(self.brief, tried=tuple(evaluations))
        return str(compute(brief, Tool(gripper=brief.gripper), self.facts))

    def line(self, evaluations: Sequence[Evaluation]) -> str:
        """Write a line for each candidate, as prompts do for the last round."""
        lines = []
        for evaluation in evaluations:
            line = f"- {evaluation.candidate.id} {number(evaluation.reward, 3)}"
            if evaluation.why_nothing:
                line += f": {self.clean(evaluation.why_nothing)}"
            lines.append(line)
        return "\n".join(lines)


def describe_rehearsal(
    played: Rehearsal, sample: int, problems: str, *, numbers: bool
) -> str:
    """Say where the robot is in a rehearsal, how near to what, and what it meets on its way, a line each.

    Args:
        played: the motion.
        sample: up to which of its samples.
        problems: what was found on the whole way, in all layouts; empty: nothing.
        numbers: whether numbers of the scene are said; else the picture says what one sees.
    """
    return fill(
        "plugins.agents",
        "rehearsal",
        played=played,
        sample=sample,
        problems=problems,
        numbers=numbers,
        short=short_numbers,
    )
