"""Do what an agent's calls ask for, in the run's thread."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Protocol, cast

from omegaconf import DictConfig, OmegaConf

from core.config.compose import task_part
from core.config.schemas import RunConfig
from core.design import Candidate, DesignError, Tool
from core.designs.curves import CURVE, vary
from core.designs.reading import dump_design, list_designs
from core.designs.replies import parse_reply
from core.designs.schema import answer_schema
from core.errors import RAISED, UserError, choices
from core.events import Result, Run
from core.interfaces import (
    Brief,
    Condition,
    Evaluation,
    Message,
    Picture,
    Score,
    Text,
    Trial,
    TriesBeside,
)
from core.plugins import SIMULATOR, PluginPart, installed
from core.scene import Scene, View
from core.search.answers import read_candidates
from core.search.builder import builder_for
from core.search.designer import ModelDesigner
from core.simulation.checking import find_problems
from core.simulation.rehearsing import rehearse
from core.simulation.series import Series, read_series
from core.store.run_figures import second_engine_figures
from core.support.templates import fill
from core.support.text import by_reason, clean
from core.trial import best_first
from core.values.plans import Anchor
from plugins.agents.agent import Agent
from plugins.agents.arguments import (
    DESIGNS,
    GUIDE,
    KINDS,
    Arguments,
    BestDesigns,
    CheckDesign,
    DescribeTask,
    Look,
    OfDesigns,
    Rehearse,
    TraceTrial,
    TryCurve,
    TryDesign,
    Watch,
    read_arguments,
    read_text,
)
from plugins.agents.bench import Answer, Later, Refused
from plugins.agents.describing import Told, describe_rehearsal
from plugins.agents.editing import change_design, list_differences
from plugins.agents.traces import draw_plot, write_table
from plugins.agents.viewing import draw_scene, draw_trial

_FELT = "N"
_LISTED = 40  # candidates that have a line
_ONLY_RULES = (
    "These are the rules of tools and plans, and what the arm misses in an empty room, where no waypoint stands by a "
    "body. Whether a tool starts clear of the scene, and what it touches, nobody measured: look shows it, and "
    "try_design finds it out."
)


@dataclass(frozen=True)
class _Emptied:
    """Takes all out of a scene: what is said of it then measures nothing in it."""

    number: int = 0

    def __call__(self, scene: Scene) -> Scene:
        return replace(scene, bodies=(), joints=(), bonds=())

    def perturb_tool(self, tool: Tool) -> Tool:
        return tool


class Driven(Protocol):
    """A search that an agent drives, as its tools see it.

    Attributes:
        asked: what composes prompts and reads designs.
        agent: has the run, and its result.
        tried: the evaluations so far.
        tie: the difference between rewards that counts as none.
        trials: tries candidates beside the search.
    """

    asked: ModelDesigner
    agent: Agent
    tried: list[Evaluation]
    tie: float
    trials: TriesBeside | None

    @property
    def rollouts(self) -> int:
        """The rollouts that were played so far."""

    @property
    def seconds(self) -> float:
        """How long the motions of these took."""

    def count_left(self, each: int, whole: int) -> int:
        """Count the tries of ``each`` rollouts that the budget still holds, where a candidate takes ``whole``."""

    def brief(self, *, gripper: bool | None = None) -> Brief:
        """Make the assignment that the agent is told."""

    def brief_reading(self) -> Brief:
        """Make the assignment by which designs are read."""

    def compose(self, brief: Brief) -> tuple[Message, ...]:
        """Compose what a prompt would hold."""


class Tools:
    """The tools, and the documents, of a run's search.

    Args:
        search: what they work on.
    """

    def __init__(self, search: Driven) -> None:
        self._search = search
        self._assumed: Sequence[str] = ()
        self._beside: list[Evaluation] = []
        self._described: dict[bool | None, Answer] = {}
        self._does: dict[str, Callable[[Any], Answer]] = {
            "describe_task": self._describe_task,
            "look": self._look,
            "rehearse": self._rehearse,
            "check_design": self._check_design,
            "try_design": self._try_design,
            "try_curve": self._try_curve,
            "wait": self._wait,
            "watch": self._watch,
            "trace": self._trace,
            "best_designs": self._best_designs,
            "finish": self._finish,
        }
        assert self._does.keys() == KINDS.keys()

    def do(self, name: str, arguments: Mapping[str, Any]) -> Answer:
        """See `plugins.agents.bench.Desk`; the address of a document gives that."""
        documents = {GUIDE: self.guide, DESIGNS: self.explain_designs}
        if name in documents:
            return [Text(documents[name]())]

        asked, self._assumed = read_arguments(name, arguments)
        return [*self._say_assumed(), *self._does[name](asked)]

    def _say_assumed(self) -> Answer:
        """Say what was assumed of the arguments of the call that is being answered."""
        return [Text(line) for line in self._assumed]

    # --- what is known of the run ---------------------------------------------------------------------------------

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of a designs document with one tool and one plan."""
        return answer_schema(self._search.brief())

    @property
    def _unseen(self) -> bool:
        """Whether nobody is told a number of the scene: then no free answer may be a ruler, and a yes or no is one."""
        return not self._search.asked.prompts.facts.level.numbers

    @property
    def _run(self) -> Run:
        run = self._search.agent.run
        assert run is not None
        return run

    @property
    def _result(self) -> Result | None:
        return self._search.agent.result

    @cached_property
    def _told(self) -> Told:
        return Told(self._search.asked.prompts.facts, self._search.brief())

    @cached_property
    def _conditions(self) -> Sequence[Condition]:
        """The conditions in which a candidate is tried, as the run's configuration has them."""
        schema = OmegaConf.structured(RunConfig)
        cfg = cast(DictConfig, OmegaConf.merge(schema, self._run.config))
        builder = builder_for(task_part(cfg))
        return builder.build_fitness(cfg, self._run.settings).conditions()

    # --- documents ------------------------------------------------------------------------------------------------

    def guide(self) -> str:
        """Say how to work at the bench."""
        budget = self._search.asked.assignment.budget
        return fill(
            "plugins.agents",
            "guide",
            most_tools=budget.n_tool,
            most_plans=budget.n_action,
            layouts=sorted({condition.layout for condition in self._conditions}),
            engines=sorted({condition.where.engine for condition in self._conditions}),
            seed=self._run.seed,
            unseen=self._unseen,
        )

    def explain_designs(self) -> str:
        """Say how designs and plans are written."""
        brief = self._search.brief()
        parts = (
            "# Tools",
            brief.representation.instructions(brief).strip(),
            "# Plans",
            brief.actions.instructions(brief).strip(),
            "# The JSON schema of a designs document",
            json.dumps(self.schema, ensure_ascii=False),
        )
        return "\n\n".join(parts)

    def _state(self) -> str:
        """Say where the run stands, and what is left."""
        search = self._search
        each = len(self._conditions)
        return fill(
            "plugins.agents",
            "state",
            tried=len(search.tried),
            rollouts=search.rollouts,
            seconds=search.seconds,
            each=each,
            left=search.count_left(each, each),
            best=next(iter(self._ranking()), None),
            ended=self._result is not None,
        )

    def _ranking(self) -> list[Evaluation]:
        return best_first(self._search.tried, self._search.tie)

    # --- tools ------------------------------------------------------------------------------------------------------

    def _describe_task(self, asked: DescribeTask) -> Answer:
        gripper = None if asked.kind is None else asked.kind == "gripper"
        kinds = self._search.asked.assignment.tool_kinds
        if asked.kind is not None and asked.kind not in kinds:
            raise Refused(f"describe_task: this task takes {' or '.join(kinds)} tools")

        return [Text(self.guide()), *self._describe(gripper), Text(self._state())]

    def _describe(self, gripper: bool | None) -> Answer:
        """Return what a prompt would say and show, which is measured once."""
        if gripper not in self._described:
            messages = self._search.compose(self._search.brief(gripper=gripper))
            parts = [part for message in messages for part in message.parts]
            self._described[gripper] = parts
        return self._described[gripper]

    def prepare(self) -> None:
        """Measure what `describe_task` says, before anybody asks; what fails is said when it is asked for."""
        with suppress(*RAISED):
            self._describe(None)

    def _look(self, asked: Look) -> Answer:
        tool: Tool | None = None
        if asked.designs is not None or asked.candidate is not None:
            first = self._read(self._write_document(asked))[0]
            if first.tool is None:
                raise Refused(f"look: {self._told.clean(first.problem or '')}")
            tool = first.tool
        shown = View(tool=tool, seed=self._run.seed)
        picture = draw_scene(self._run, asked, shown)
        return [Text(picture.caption), picture]

    def _rehearse(self, asked: Rehearse) -> Answer:
        first = self._read(self._write_document(asked), starts=not self._unseen)[0]
        if first.problem is not None:
            raise Refused(f"rehearse: {self._told.clean(first.problem)}")

        condition = self._choose_condition(asked.layout)
        try:
            played = rehearse(condition, first, checks=not self._unseen)
            sample = played.find_sample(asked.waypoint, asked.time_s)
        except DesignError as error:
            raise Refused(f"rehearse: {self._told.clean(str(error))}") from error

        taken = played.recording
        shown = View(
            tool=first.tool,
            seed=condition.layout,
            arm=taken.arm[sample],
            fingers=taken.fingers[sample],
        )
        picture = draw_scene(self._run, asked, shown)
        problems = "" if self._unseen else self._find_problems(first)
        lines = describe_rehearsal(played, sample, problems, numbers=not self._unseen)
        return [Text("\n".join(lines)), Text(picture.caption), picture]

    def _choose_condition(self, layout: int | None) -> Condition:
        """Return the condition of the search with this layout; without one that of the pictures, or else the first."""
        layouts = sorted({condition.layout for condition in self._conditions})
        wanted = self._run.seed if layout is None else layout
        for condition in self._conditions:
            if condition.layout == wanted and condition.change is None:
                return condition
        if layout is None:
            return self._conditions[0]
        listed = ", ".join(map(str, layouts))
        raise Refused(f"no layout {layout} in the search; there are: {listed}")

    def _write_document(self, asked: OfDesigns) -> str:
        """Return the text of the designs document that a call names.

        Raises:
            Refused: it names none, or two, or changes what is not there.
        """
        if (asked.designs is None) == (asked.candidate is None):
            raise Refused("designs: give a document, or else candidate and change")
        if asked.designs is not None:
            if asked.change:
                raise Refused("change goes with candidate, not with designs")
            return read_text(asked.designs)

        assert asked.candidate is not None
        design = self._dump(self._find(asked.candidate).candidate)
        changed = change_design(design, asked.change)
        return read_text({"strategies": [changed]})

    def _dump(self, candidate: Candidate) -> dict[str, Any]:
        """Write a candidate that was tried as a design, of which it is a parent.

        Raises:
            Refused: it has no tool.
        """
        if candidate.tool is None:
            raise Refused(f"{candidate.id} has no tool that could be read")
        representation = self._search.brief_reading().representation
        design = dump_design(candidate, representation)
        design["parents"] = [candidate.id]
        return design

    def _check_design(self, asked: CheckDesign) -> Answer:
        lines = []
        for candidate in self._read(
            self._write_document(asked), starts=not self._unseen
        ):
            found = self._find_problems(candidate) or "nothing found"
            lines.append(f"- {_name(candidate)}: {found}")
        if self._unseen:
            lines.append(_ONLY_RULES)
        return [Text("\n".join(lines))]

    def _refuse(self, candidate: Candidate) -> str:
        """Say why a candidate is refused, in words and in codes; without codes where something is not told."""
        problem = candidate.problem or ""
        said = self._told.clean(problem)
        if said != problem:
            return said
        return " ".join([said, *(f"[{refusal}]" for refusal in candidate.refusals)])

    def _find_problems(self, candidate: Candidate) -> str:
        """Say what is wrong with a candidate in the layouts of the search, on one line; empty: nothing was found."""
        if candidate.problem is not None:
            return self._refuse(candidate)
        conditions = self._conditions
        if self._unseen:
            if any(anchor != Anchor() for anchor in candidate.plan.anchors):
                return ""
            conditions = [replace(conditions[0], change=_Emptied())]

        found = [
            (f"layout {condition.layout}", self._told.clean(problem))
            for condition in conditions
            for problem in find_problems(condition, candidate)
        ]
        if len(conditions) == 1:
            return "; ".join(dict.fromkeys(problem for _, problem in found))
        return "; ".join(map(str, by_reason(found)))

    def _try_design(self, asked: TryDesign) -> Answer:
        if self._result is not None:
            raise Refused(
                "try_design: the run has come to its end; nothing is tried any more"
            )

        text = self._write_document(asked)
        candidates = self._read(text, starts=not self._unseen)
        faults = [
            f"- {_name(candidate)}: {self._refuse(candidate)}"
            for candidate in candidates
            if candidate.problem is not None
        ]
        if faults:
            listed = "\n".join(faults)
            raise Refused(f"Nothing was tried, and nothing is counted:\n{listed}")

        if asked.layouts is not None or asked.engine is not None:
            return self._try_beside(asked, candidates)

        designs = list_designs(parse_reply(text))
        curves = sum(bool(design.get(CURVE)) for design in designs)
        raise self._pay(text, len(candidates) + curves * self._curve)

    def _try_beside(self, asked: TryDesign, candidates: Sequence[Candidate]) -> Answer:
        """Play candidates in some layouts of the search, or in another engine: they are none of the search."""
        conditions = self._choose_conditions(asked)
        self._check_budget(len(candidates), len(conditions))
        search = self._search
        assert search.trials is not None
        number = len(self._beside) + 1
        named = [replace(each, agent=number) for each in candidates]

        evaluations = []
        with self._search.agent.playing():
            for candidate, trials in search.trials.try_in(conditions, named):
                mean = sum(trial.reward for trial in trials) / len(trials)
                evaluations.append(Evaluation(candidate, trials, Score(mean)))

        self._beside += evaluations
        answer = [_dump(self._told.describe(each)) for each in evaluations]
        for evaluation in evaluations:
            answer += self._told.compare_engines(evaluation, search.trials.known)
        return [Text("\n\n".join([*answer, self._state()]))]

    def _choose_conditions(self, asked: TryDesign) -> list[Condition]:
        """Return the conditions in which a call tries designs beside the search.

        Raises:
            Refused: no such layout of the search, or no such engine.
        """
        if asked.layouts is None:
            conditions = [self._choose_condition(None)]
        else:
            conditions = [self._choose_condition(each) for each in asked.layouts]
        if asked.engine is None:
            return list(dict.fromkeys(conditions))

        names = installed().names(SIMULATOR.name)
        if asked.engine not in names:
            raise Refused(str(choices("engine", clean(asked.engine, 60), names)))
        sim = PluginPart(SIMULATOR.name, asked.engine)
        try:
            sim.shared()
        except UserError as error:  # its package is missing
            raise Refused(f"try_design: {error}") from error
        return [replace(each, sim=sim, engine="") for each in dict.fromkeys(conditions)]

    def _try_curve(self, asked: TryCurve) -> Answer:
        if self._result is not None or not self._curve:
            raise Refused(
                "try_curve: the run has come to its end, or budget.curves is 0; nothing is tried"
            )

        candidate = self._find(asked.candidate).candidate
        design = self._dump(candidate)
        design[CURVE] = [asdict(axis) for axis in asked.axes]
        try:
            list(vary(candidate, asked.axes, self._curve))
        except DesignError as error:
            raise Refused(f"try_curve: {error}") from error

        text = json.dumps({"strategies": [design]}, ensure_ascii=False)
        raise self._pay(text, 1 + self._curve)

    @property
    def _curve(self) -> int:
        """How many designs are tried of a curve."""
        return self._search.asked.assignment.budget.curves

    def _pay(self, text: str, count: int) -> Later:
        """Return what makes the run go on and try a document's candidates.

        Raises:
            Refused: the budget does not hold so many.
        """
        self._check_budget(count, len(self._conditions))
        return Later(text)

    def _check_budget(self, count: int, each: int) -> None:
        """Check that so many candidates may be tried, of which one takes ``each`` rollouts.

        Raises:
            Refused: the budget does not hold them.
        """
        left = self._search.count_left(each, len(self._conditions))
        if count > left:
            raise Refused(
                f"Nothing was tried: these are {count} candidates, and the budget holds {left} more. {self._state()}"
            )

    def _watch(self, asked: Watch) -> Answer:
        evaluation = self._find(asked.candidate)
        trial = self._choose_trial(evaluation, asked.layout)
        strip = draw_trial(self._search.asked.artist, evaluation, trial)
        return [Text(strip.caption), strip]

    def _trace(self, asked: TraceTrial) -> Answer:
        names = [asked.candidate]
        if asked.beside is not None:
            names.append(asked.beside)
        evaluations = [self._find(name) for name in names]

        answer: list[Text | Picture] = []
        trials: dict[str, Sequence[Series]] = {}
        for evaluation in evaluations:
            trial = self._choose_trial(evaluation, asked.layout)
            name = f"{evaluation.candidate.id}, layout {trial.layout}"
            trials[name] = self._read_series(evaluation, trial)
            table = write_table(trials[name]) if trials[name] else "nothing to show"
            answer.append(Text(f"{name}:\n{table}"))

        if len(evaluations) > 1:
            first, second = (
                {**self._dump(each.candidate), "parents": []} for each in evaluations
            )
            differ = list_differences(first, second)[:_LISTED]
            answer.append(Text("\n".join(["their designs differ in:", *differ])))
        if any(trials.values()):
            plot = draw_plot(trials)
            answer += [Text(plot.caption), plot]
        return answer

    def _read_series(self, evaluation: Evaluation, trial: Trial) -> list[Series]:
        """Play a trial once more, and return what may be said of it over time."""
        name = evaluation.candidate.id
        for condition in self._conditions:
            if condition.where == trial.where:
                break
        else:
            raise Refused(f"trace: {name} was played in another engine than the run's")
        try:
            series = read_series(condition, evaluation.candidate)
        except DesignError as error:
            reason = self._told.clean(str(error))
            raise Refused(f"trace: {name}: {reason}") from error

        if self._unseen:  # the arm feels what it presses; all else nobody measured
            return [each for each in series if each.unit == _FELT]
        return series

    def _choose_trial(self, evaluation: Evaluation, layout: int | None) -> Trial:
        played = [
            t for t in evaluation.trials if t.status == "ok" and t.where.change is None
        ]
        if not played:
            reason = self._told.clean(evaluation.reason)
            raise Refused(f"watch: {evaluation.candidate.id} was not played: {reason}")
        if layout is None:
            return min(played, key=lambda trial: trial.reward)

        for trial in played:
            if trial.layout == layout:
                return trial
        layouts = ", ".join(str(trial.layout) for trial in played)
        raise Refused(
            f"watch: {evaluation.candidate.id} was played in the layouts {layouts}"
        )

    def _best_designs(self, asked: BestDesigns) -> Answer:
        ranking = self._ranking()
        whole = [self._told.describe_whole(e) for e in ranking[: asked.count]]
        others = [*ranking[asked.count :], *self._unplayed()]
        lines = [_dump(entry) for entry in whole]
        if others:
            lines.append(self._told.line(others[:_LISTED]))
        if len(others) > _LISTED:
            lines.append(f"- and {len(others) - _LISTED} others")
        lines.append(self._state())
        return [Text("\n\n".join(lines))]

    def _unplayed(self) -> list[Evaluation]:
        return [e for e in self._search.tried if e.status != "ok"]

    def _wait(self, asked: Arguments) -> Answer:
        if self._result is not None:
            return self.describe_result()
        return [Text(f"Nothing goes on. {self._state()}")]

    def _finish(self, asked: Arguments) -> Answer:
        if self._result is not None:
            return self.describe_result()
        if not self._ranking():
            raise Refused("finish: no candidate was played yet; try one first")
        raise Later(None)

    # --- answers that the run makes -------------------------------------------------------------------------------

    def describe(self, evaluations: Sequence[Evaluation]) -> Answer:
        """Say what came of the candidates of a call."""
        curve = [e for e in evaluations if e.candidate.varied is not None]
        others = [e for e in evaluations if e.candidate.varied is None]
        entries = [_dump(self._told.describe(evaluation)) for evaluation in others]
        if curve:
            entries.append(self._told.describe_curve(curve))
        return [*self._say_assumed(), Text("\n\n".join([*entries, self._state()]))]

    def describe_result(self) -> Answer:
        """Say what the run came to."""
        result = self._result
        assert result is not None
        best = result.best
        assert best is not None
        unseen = {
            engine: (sum(rewards) / len(rewards), min(rewards), len(rewards))
            for engine, rewards in result.unseen.items()
        }
        text = fill(
            "plugins.agents",
            "result",
            best=best,
            held=result.held,
            unseen=unseen,
            second_engine=second_engine_figures(result),
            stopped=result.stopped,
            rollouts=result.rollouts,
            folder=self._run.folder.resolve(),
        )
        return [Text(text)]

    # --- reading ----------------------------------------------------------------------------------------------------

    def _read(self, text: str, *, starts: bool = True) -> list[Candidate]:
        """Read the candidates of a designs document, with the rule that each breaks, if any.

        Args:
            text: the document.
            starts: a tool that does not start clear of everything breaks a rule.

        Raises:
            Refused: it can't be read, or holds more than a call may.
        """
        brief = self._search.brief_reading()
        try:
            designs = list_designs(parse_reply(text))
        except DesignError as error:
            raise Refused(f"designs: {error}") from error

        self._refuse_many(designs, brief)
        return read_candidates(brief, designs, starts=starts)

    def _refuse_many(self, designs: Sequence[Any], brief: Brief) -> None:
        """Refuse a document of which a part would not be read."""
        plans = [
            len(design["action_sets"])
            for design in designs
            if isinstance(design, dict) and isinstance(design.get("action_sets"), list)
        ]
        if len(designs) > brief.n_tool or max(plans, default=0) > brief.n_action:
            raise Refused(
                f"designs: a call holds at most {brief.n_tool} tools with {brief.n_action} plans each"
            )

    def _find(self, name: str) -> Evaluation:
        """Return the evaluation of a candidate.

        Raises:
            Refused: none of this id was tried.
        """
        tried = [*self._search.tried, *self._beside]
        found = [e for e in tried if e.candidate.id == name]
        if not found:  # its end names it, where no other ends so
            found = [e for e in tried if e.candidate.id.endswith(f"-{name}")]
        if len(found) != 1:
            raise Refused(
                f"no candidate {clean(name, 60)!r} was tried; best_designs lists those that were"
            )
        return found[0]


def _name(candidate: Candidate) -> str:
    return f"design {candidate.design + 1}, plan {candidate.action + 1}"


def _dump(entry: Mapping[str, Any]) -> str:
    return json.dumps(entry, ensure_ascii=False)
