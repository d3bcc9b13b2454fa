"""Do what an agent's calls ask for, in the run's thread."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

from core.design import Candidate, DesignError, Fork, Tool
from core.designs.curves import CURVE, vary
from core.designs.reading import list_designs
from core.designs.replies import parse_reply
from core.designs.schema import answer_schema
from core.errors import RAISED, UserError, choices
from core.events import Result
from core.interfaces import (
    Condition,
    Evaluation,
    Picture,
    Score,
    Text,
    Trial,
)
from core.plugins import SIMULATOR, PluginPart, installed
from core.scene import View
from core.simulation.rehearsing import rehearse
from core.simulation.series import Series, read_series
from core.store.run_figures import second_engine_figures
from core.support.templates import fill
from core.support.text import clean
from plugins.agents.arguments import (
    DESIGNS,
    GUIDE,
    KINDS,
    Arguments,
    BestDesigns,
    DescribeTask,
    Look,
    OfDesigns,
    Rehearse,
    TraceTrial,
    TryCurve,
    TryDesign,
    Watch,
    read_arguments,
)
from plugins.agents.bench import Answer, Later, Refused
from plugins.agents.describing import describe_rehearsal
from plugins.agents.drafts import (
    name_draft,
    read_document,
    say_problems,
    say_refusal,
    write_design,
    write_document,
)
from plugins.agents.editing import list_differences
from plugins.agents.session import Session
from plugins.agents.traces import draw_plot, write_table
from plugins.agents.viewing import draw_scene, draw_trial

_FELT = "N"
_LISTED = 40  # candidates that have a line
_ONLY_RULES = (
    "These are the rules of tools and plans, and what the arm misses in an empty room, where no waypoint stands by a "
    "body. Whether a tool starts clear of the scene, and what it touches, nobody measured: look shows it, and "
    "try_design finds it out."
)


class Tools:
    """The tools, and the documents, of a run's search.

    Args:
        session: what they work on.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._assumed: Sequence[str] = ()
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
        return answer_schema(self._session.brief())

    @property
    def _result(self) -> Result | None:
        return self._session.agent.result

    def _read(self, asked: OfDesigns) -> list[Candidate]:
        """Read the candidates of a designs document that a call names."""
        text = write_document(self._session, asked)
        return read_document(self._session, text, starts=not self._session.unseen)

    # --- documents ------------------------------------------------------------------------------------------------

    def guide(self) -> str:
        """Say how to work at the bench."""
        budget = self._session.asked.assignment.budget
        return fill(
            "plugins.agents",
            "guide",
            most_tools=budget.n_tool,
            most_plans=budget.n_action,
            layouts=sorted(
                {condition.layout for condition in self._session.conditions}
            ),
            engines=sorted(
                {condition.where.engine for condition in self._session.conditions}
            ),
            seed=self._session.run.seed,
            unseen=self._session.unseen,
        )

    def explain_designs(self) -> str:
        """Say how designs and plans are written."""
        brief = self._session.brief()
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
        session = self._session
        each = len(self._session.conditions)
        return fill(
            "plugins.agents",
            "state",
            tried=len(session.tried),
            rollouts=session.rollouts,
            seconds=session.seconds,
            each=each,
            left=session.count_left(each),
            best=next(iter(self._session.rank()), None),
            ended=self._result is not None,
        )

    # --- tools ------------------------------------------------------------------------------------------------------

    def _describe_task(self, asked: DescribeTask) -> Answer:
        gripper = None if asked.kind is None else asked.kind == "gripper"
        kinds = self._session.asked.assignment.tool_kinds
        if asked.kind is not None and asked.kind not in kinds:
            raise Refused(f"describe_task: this task takes {' or '.join(kinds)} tools")

        return [Text(self.guide()), *self._describe(gripper), Text(self._state())]

    def _describe(self, gripper: bool | None) -> Answer:
        """Return what a prompt would say and show, which is measured once."""
        if gripper not in self._described:
            messages = self._session.compose(self._session.brief(gripper=gripper))
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
            first = self._read(asked)[0]
            if first.tool is None:
                raise Refused(
                    f"look: {self._session.describer.clean(first.problem or '')}"
                )
            tool = first.tool
        shown = View(tool=tool, seed=self._session.run.seed)
        picture = draw_scene(self._session.run, asked, shown)
        return [Text(picture.caption), picture]

    def _rehearse(self, asked: Rehearse) -> Answer:
        first = self._read(asked)[0]
        if first.problem is not None:
            raise Refused(f"rehearse: {self._session.describer.clean(first.problem)}")

        condition = self._session.choose_condition(asked.layout)
        try:
            played = rehearse(condition, first, checks=not self._session.unseen)
            sample = played.find_sample(asked.waypoint, asked.time_s)
        except DesignError as error:
            raise Refused(
                f"rehearse: {self._session.describer.clean(str(error))}"
            ) from error

        taken = played.recording
        shown = View(
            tool=first.tool,
            seed=condition.layout,
            arm=taken.arm[sample],
            fingers=taken.fingers[sample],
        )
        picture = draw_scene(self._session.run, asked, shown)
        problems = ""
        if not self._session.unseen:
            problems = say_problems(self._session, first)
        said = describe_rehearsal(
            played, sample, problems, numbers=not self._session.unseen
        )
        return [Text(said), Text(picture.caption), picture]

    def _check_design(self, asked: OfDesigns) -> Answer:
        lines = []
        for candidate in self._read(asked):
            found = say_problems(self._session, candidate) or "nothing found"
            lines.append(f"- {name_draft(candidate)}: {found}")
        if self._session.unseen:
            lines.append(_ONLY_RULES)
        return [Text("\n".join(lines))]

    def _try_design(self, asked: TryDesign) -> Answer:
        if self._result is not None:
            raise Refused(
                "try_design: the run has come to its end; nothing is tried any more"
            )

        candidates = self._read(asked)
        faults = [
            f"- {name_draft(candidate)}: {say_refusal(self._session, candidate)}"
            for candidate in candidates
            if candidate.problem is not None
        ]
        if faults:
            listed = "\n".join(faults)
            raise Refused(f"Nothing was tried, and nothing is counted:\n{listed}")

        beside = (asked.layouts, asked.engine, asked.from_waypoint)
        if any(wish is not None for wish in beside):
            return self._try_beside(asked, candidates)

        text = write_document(self._session, asked)
        designs = list_designs(parse_reply(text))
        curves = sum(bool(design.get(CURVE)) for design in designs)
        raise self._pay(text, len(candidates) + curves * self._curve)

    def _try_beside(self, asked: TryDesign, candidates: Sequence[Candidate]) -> Answer:
        """Play candidates in some layouts of the search, in another engine, or from where an earlier one was.

        They are none of the search.
        """
        conditions = self._choose_conditions(asked)
        fork = self._find_fork(asked, conditions)
        self._check_budget(len(candidates), len(conditions))
        session = self._session
        player = session.strategy.trials
        assert player is not None
        number = len(session.beside) + 1
        named = [replace(each, agent=number, fork=fork) for each in candidates]

        evaluations = []
        with self._session.agent.playing():
            for candidate, trials in player.try_in(conditions, named):
                mean = sum(trial.reward for trial in trials) / len(trials)
                evaluations.append(Evaluation(candidate, trials, Score(mean)))

        session.beside += evaluations
        answer = [_dump(self._session.describer.describe(each)) for each in evaluations]
        for evaluation in evaluations:
            answer += self._session.describer.describe_beginnings(evaluation)
            answer += self._session.describer.compare_engines(evaluation, player.known)
        return [Text("\n\n".join([*answer, self._state()]))]

    def _find_fork(
        self, asked: TryDesign, conditions: Sequence[Condition]
    ) -> Fork | None:
        """Return where the trials of a call go on from; None: they begin at the start.

        Raises:
            Refused: it names no candidate that was played there, or none of its waypoints.
        """
        if asked.from_waypoint is None:
            return None
        if asked.candidate is None:
            raise Refused("try_design: from_waypoint goes with candidate and change")

        earlier = self._session.find(asked.candidate)
        played = {trial.where for trial in earlier.trials if trial.status == "ok"}
        for condition in conditions:
            if condition.where not in played:
                raise Refused(
                    f"try_design: {earlier.candidate.id} was not played in layout {condition.layout} in "
                    f"{condition.where.engine}, so nothing goes on from there; name others in `layouts`"
                )
            self._check_waypoint(condition, earlier.candidate, asked.from_waypoint)
        return Fork(earlier.candidate, asked.from_waypoint)

    def _check_waypoint(
        self, condition: Condition, candidate: Candidate, waypoint: int
    ) -> None:
        """Check that a plan has a waypoint, as far as its number of waypoints is known without playing it."""
        rehearsal = rehearse(condition, candidate, checks=False)
        if rehearsal.planned.job.reactions is not None:
            return
        try:
            rehearsal.find_sample(waypoint, None)
        except DesignError as error:
            raise Refused(f"try_design: {error}") from error

    def _choose_conditions(self, asked: TryDesign) -> list[Condition]:
        """Return the conditions in which a call tries designs beside the search.

        Raises:
            Refused: no such layout of the search, or no such engine.
        """
        if asked.layouts is None:
            conditions = [self._session.choose_condition(None)]
        else:
            conditions = [
                self._session.choose_condition(each) for each in asked.layouts
            ]
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

        candidate = self._session.find(asked.candidate).candidate
        design = write_design(self._session, candidate)
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
        return self._session.asked.assignment.budget.curves

    def _pay(self, text: str, count: int) -> Later:
        """Return what makes the run go on and try a document's candidates.

        Raises:
            Refused: the budget does not hold so many.
        """
        self._check_budget(count, len(self._session.conditions))
        return Later(text)

    def _check_budget(self, count: int, each: int) -> None:
        """Check that so many candidates may be tried, of which one takes ``each`` rollouts.

        Raises:
            Refused: the budget does not hold them.
        """
        left = self._session.count_left(each)
        if count > left:
            raise Refused(
                f"Nothing was tried: these are {count} candidates, and the budget holds {left} more. {self._state()}"
            )

    def _watch(self, asked: Watch) -> Answer:
        evaluation = self._session.find(asked.candidate)
        trial = self._choose_trial(evaluation, asked.layout)
        task = self._session.run.task
        artist = self._session.asked.artist
        strip = draw_trial(task, artist, evaluation, trial, asked)
        return [Text(strip.caption), strip]

    def _trace(self, asked: TraceTrial) -> Answer:
        names = [asked.candidate]
        if asked.beside is not None:
            names.append(asked.beside)
        evaluations = [self._session.find(name) for name in names]

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
                {**write_design(self._session, each.candidate), "parents": []}
                for each in evaluations
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
        for condition in self._session.conditions:
            if condition.where == trial.where:
                break
        else:
            raise Refused(f"trace: {name} was played in another engine than the run's")
        try:
            series = read_series(condition, evaluation.candidate)
        except DesignError as error:
            reason = self._session.describer.clean(str(error))
            raise Refused(f"trace: {name}: {reason}") from error

        if (
            self._session.unseen
        ):  # the arm feels what it presses; all else nobody measured
            return [each for each in series if each.unit == _FELT]
        return series

    def _choose_trial(self, evaluation: Evaluation, layout: int | None) -> Trial:
        played = [
            t for t in evaluation.trials if t.status == "ok" and t.where.change is None
        ]
        if not played:
            reason = self._session.describer.clean(evaluation.reason)
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
        ranking = self._session.rank()
        whole = [
            self._session.describer.describe_whole(e) for e in ranking[: asked.count]
        ]
        unplayed = [e for e in self._session.tried if e.status != "ok"]
        others = [*ranking[asked.count :], *unplayed]
        lines = [_dump(entry) for entry in whole]
        if others:
            lines.append(self._session.describer.line(others[:_LISTED]))
        if len(others) > _LISTED:
            lines.append(f"- and {len(others) - _LISTED} others")
        lines.append(self._state())
        return [Text("\n\n".join(lines))]

    def _wait(self, asked: Arguments) -> Answer:
        if self._result is not None:
            return self.describe_result()
        return [Text(f"Nothing goes on. {self._state()}")]

    def _finish(self, asked: Arguments) -> Answer:
        if self._result is not None:
            return self.describe_result()
        if not self._session.rank():
            raise Refused("finish: no candidate was played yet; try one first")
        raise Later(None)

    # --- answers that the run makes -------------------------------------------------------------------------------

    def describe(self, evaluations: Sequence[Evaluation]) -> Answer:
        """Say what came of the candidates of a call."""
        curve = [e for e in evaluations if e.candidate.varied is not None]
        others = [e for e in evaluations if e.candidate.varied is None]
        entries = [
            _dump(self._session.describer.describe(evaluation)) for evaluation in others
        ]
        if curve:
            entries.append(self._session.describer.describe_curve(curve))
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
            folder=self._session.run.folder.resolve(),
        )
        return [Text(text)]


def _dump(entry: Mapping[str, Any]) -> str:
    return json.dumps(entry, ensure_ascii=False)
