"""Make a run from a configuration, or resume one: what ``python -m core.run`` and `Experiment` do."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, cast

import pluggy
from omegaconf import DictConfig, OmegaConf

from core.config.compose import check_seed, load, node, part, task_part, tool_part
from core.config.resume import changed, hydra_config, refuse_stored_receivers
from core.config.schemas import PromptSettings, Sampling
from core.config.sources import new_folder, stamp, task_folder
from core.config.trust import refuse_keys
from core.design import TIE, Candidate
from core.designs.composer import PromptComposer
from core.designs.planning import resolve
from core.designs.reading import save_design
from core.errors import RAISED, UsageError, UserError, fault
from core.events import INTERRUPTED, Result, Run
from core.interfaces import (
    VLM,
    Budget,
    EvolutionStrategy,
    Executor,
    Fitness,
    Reply,
    Robot,
    RolloutSettings,
)
from core.plugins import ACTION, EVOLUTION, EXECUTOR, MODEL, SIMULATOR, event_hub, installed
from core.plugins.blame import Guard, add_listener, describe_failure, refuse_exit
from core.robot.kinematics import arm_of
from core.robot.tempo import plan_task_motion
from core.robot.trajectory import Motion
from core.search.designer import DEFAULT_KINDS, Assignment, ModelDesigner, make_designer
from core.search.evolution import evolve
from core.search.finalists import choose, try_unseen
from core.search.refinement import Refinement
from core.simulation.pictures import report_missing, save_film
from core.simulation.together import Together, make_fitness
from core.store.database import writing
from core.store.progress import CachedVLM
from core.store.recorder import RunStore, best_figures, unseen_figures
from core.support.cli import say
from core.support.text import hydra_word

Export = Callable[[Candidate, Robot, Motion, Path], None]
"""Writes files of a candidate to a folder that is there: of its tool, the arm, and the planned motion."""

# Kinds of parts whose names a run's listeners receive.
_PARTS = ("task", "sim", "vlm", "tool", "action", "evolution", "fitness", "executor")


@dataclass(frozen=True, eq=False)
class _Search:
    """All that takes part in a search."""

    run: Run
    designer: ModelDesigner
    strategy: EvolutionStrategy
    fitness: Fitness
    executor: Executor
    events: pluggy.PluginManager
    guards: list[Guard]


@refuse_exit()
def _made(cfg: DictConfig, folder: Path, replies: Mapping[str, Reply]) -> _Search:
    """Make the parts that ``cfg`` names; a model's ``replies`` are not asked for again.

    Raises:
        UserError: a part or setting that can't be used.
    """
    config = cast(dict[str, Any], OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True))
    refuse_keys(OmegaConf.create(config))
    vlm, events, sim = part(MODEL, cfg.vlm).create(), event_hub(), part(SIMULATOR, cfg.sim).create()
    designer, fitness = make_asking(cfg, CachedVLM(vlm, replies) if replies else vlm, events)
    task, representation, budget = designer.task, designer.representation, designer.budget
    executor: Executor = part(EXECUTOR, cfg.executor).create()
    strategy: EvolutionStrategy = part(EVOLUTION, cfg.evolution).create(designer=designer, budget=budget)
    if strategy.learns:
        events.register(designer, "designer")
    if (refine := config["evolution"].get("refine", 0)) != 0:
        strategy = Refinement(strategy, designer, refine)
    listeners = config["listener"].items()
    made = {name: installed().create("listener", name, options or {}) for name, options in listeners}
    guards = [add_listener(events, listener, name) for name, listener in {**made, "vlm": vlm}.items()]
    parts = {kind: config[kind]["name"] for kind in _PARTS}
    parts |= {"robot": task.robot.name, "material": representation.material.name}
    if task.language != "python" or len(task.parts) > 1:
        parts["task"] = task.name  # a file's own, so that two scenes are two tasks
    settings = designer.prompts.rollout
    this = Run(folder, config, parts, vlm.model, task, representation, budget, cfg.seed, sim, settings)
    return _Search(this, designer, strategy, fitness, executor, events, guards)


def make_asking(cfg: DictConfig, vlm: VLM, events: pluggy.PluginManager) -> tuple[ModelDesigner, Fitness]:
    """Make what asks ``vlm`` for candidates in a run with this configuration, and what judges them.

    Raises:
        UserError: a part or setting that can't be used.
    """
    budget = Budget(**{field.name: cfg.budget[field.name] for field in fields(Budget)})
    for name, least in (("n_agent", 1), ("n_tool", 1), ("n_action", 1), ("k_top", 1), ("n_iteration", 0)):
        if getattr(budget, name) < least:
            raise UsageError(f"budget.{name} must be at least {least}, got {getattr(budget, name)}")
    check_seed(cfg.seed)
    task, sim, representation = task_part(cfg).create(), part(SIMULATOR, cfg.sim), tool_part(cfg).create()
    for one in task.parts:
        arm_of(task.robot).home_for(one.home)  # an arm that can't start is reported once, before it is drawn
    if representation.given(task) is not None:
        budget = replace(budget, n_tool=1)
    settings = node(cfg.rollout, RolloutSettings)
    strategy = installed().factory("evolution", cfg.evolution.name)  # whether it needs observations is settled before
    own = cast(dict[str, Any], OmegaConf.to_container(cfg.evolution))
    observes = getattr(strategy, "observes", EvolutionStrategy.observes)(own)
    if cfg.prompt.feedback != "paper" or cfg.prompt.critic or observes:
        settings = replace(settings, observe=True)
    fitness = make_fitness(cfg, settings)
    prompt, tie = node(cfg.prompt, PromptSettings), cfg.evolution.get("tie", TIE)
    kinds = cfg.task.get("tool_kinds") or task.tool_kinds or DEFAULT_KINDS
    judged = {"": fitness.instructions()}
    if isinstance(fitness, Together):
        judged |= {one.name: fitness.instructions_of(one.name) for one in task.parts}
    prompts = {
        name: PromptComposer(prompt, settings, cfg.sim.name, tie=tie, judged=text) for name, text in judged.items()
    }
    designer = make_designer(
        Assignment(task, representation, part(ACTION, cfg.action).create(), budget, cfg.seed, kinds),
        sim.create,
        vlm,
        prompts.pop(""),
        node(cfg.sampling, Sampling),
        events,
        prompts,
    )
    return designer, fitness


def run(cfg: DictConfig, folder: Path, store: RunStore | None = None) -> Result:
    """Make the parts that ``cfg`` names, run the loop, and leave everything in ``folder``.

    ``store`` is the store of the run in ``folder`` that is resumed; None: a new run.

    Raises:
        UserError: a part or setting that can't be used, a folder that holds a run already or can't be written, or a
            listener that tried to end the process, once the run has come to its end.
        KeyboardInterrupt: outside of the loop (inside: `Result.stopped`); says how to go on.
    """
    search = _made(cfg, folder, store.past.replies if store is not None else {})
    store = store or RunStore.create(folder, search.run.config)  # from here on the folder is this run's
    # Registered last it is called first, and what it raises ends the run: no reply and no evaluation may be lost.
    search.events.register(store, "store")
    try:
        return _searched(search, store, film=cfg.film)
    except UserError as error:
        raise UserError(f"{error}; {resume_hint(folder)}") from error
    except KeyboardInterrupt:
        raise KeyboardInterrupt(resume_hint(folder)) from None
    except Exception as error:
        blamed, machine = describe_failure(error), fault(error)
        if machine is not None:
            raise UserError(f"{blamed or machine}; {resume_hint(folder)}") from error
        for note in filter(None, (blamed, resume_hint(folder))):
            error.add_note(note)
        raise
    finally:
        search.events.hook.run_ended()


@refuse_exit()
def _searched(search: _Search, store: RunStore, *, film: bool) -> Result:
    """Run the loop, and write what it found."""
    this, events = search.run, search.events
    with writing(this.folder):
        drawn = (several for of in search.designer.pictures.values() for several in of.values())
        for picture in (each for several in drawn for each in several):
            if picture.name == "scene":
                (this.folder / "scene.png").write_bytes(picture.png)
    events.hook.run_started(run=this)
    with search.executor:
        result = evolve(
            search.strategy,
            search.fitness,
            search.executor,
            this.budget,
            events,
            store.past.evaluation,
            this.task.robot,
        )
        if result.best is not None and result.stopped != INTERRUPTED:
            winner, finals = choose(result, search.fitness, search.executor, events)
            result = replace(result, winner=winner, finals=finals)
            unseen, effort = try_unseen(winner, search.fitness, search.executor)
            result = replace(result, unseen=unseen, effort=effort)
    result = replace(result, wall_time_s=store.seconds + result.wall_time_s)
    with writing(this.folder):
        save_best(result, this, search.strategy, film=film)
    events.hook.run_finished(run=this, result=result)
    if exited := [guard.exited for guard in search.guards if guard.exited]:
        raise UserError(f"{exited[0]}; the run came to its end without it")
    return result


def save_best(result: Result, this: Run, strategy: EvolutionStrategy, *, film: bool) -> None:
    """Write the best design to ``best/``, with a film of its rollout unless the run was interrupted.

    What else a strategy hands over lies beside it (`core.interfaces.EvolutionStrategy.hand_over`).
    """
    best, whole, archive = result.best, this.folder / "best", this.folder / "archive"
    if best is None or this.simulator is None:
        return
    for old in (whole, archive):
        if old.is_symlink():
            old.unlink()
        shutil.rmtree(old, ignore_errors=True)  # a resumed run has those of an earlier end
    strategy.hand_over(result.ranking, this.representation, archive)
    several = len(this.task.parts) > 1
    if several:
        save_design(best.candidate, this.representation, whole)
    for task in this.task.parts:
        candidate, folder = best.candidate.of(task.name), whole / task.name if several else whole
        if candidate.problem is not None:
            report_missing(f"motion for {task.name}", UserError(candidate.problem))
            continue
        plan = resolve(candidate.plan, task, this.seed, this.settings)
        motion = plan_task_motion(plan, task, this.settings)
        save_design(candidate, this.representation, folder)
        for export in installed().factories("export").values():
            export(candidate, task.robot, motion, folder)
        if film and result.stopped != INTERRUPTED:
            try:
                save_film(task, this.simulator, candidate, this.seed, this.settings, folder / "rollout.gif")
            except RAISED as error:  # a film that fails costs the film, never the run
                report_missing("film", error)


def resume_hint(folder: Path) -> str:
    """Say what to type to resume the run."""
    return f"to go on: python -m core.run resume={shlex.quote(str(folder))}"


def resume(folder: Path, overrides: Sequence[str] = ()) -> None:
    """Go on with the run in ``folder``, and print its outcome.

    Raises:
        UserError: there is no run, its store can't be used, or ``overrides`` change what can't be changed.
    """
    store = RunStore.open(folder)
    if store is None:
        config = hydra_config(folder)
        refuse_stored_receivers(config, overrides)
        print_outcome(run(changed(config, overrides), folder), folder)
        return
    try:
        cfg = changed(store.config, overrides)
        ended, before = store.result, store.config["budget"]
        more = any(cfg.budget[key] != before[key] for key in ("n_iteration", "stop_reward"))
        more |= cfg.evolution.get("refine", 0) != store.config["evolution"].get("refine", 0)
        if ended is not None and ended["stopped"] is None and not more:
            say(f"{folder} holds a run that has come to its end")
            print_best(ended["best"], folder, unseen=ended.get("unseen"))
            return
        refuse_stored_receivers(store.config, overrides)
        store.overrides = overrides
        there = f"{len(store.past.replies)} replies and {len(store.past.candidates)} evaluated candidates are there"
        if store.past.again:
            there += f"; {len(store.past.again)} requests without an answer are sent again"
        say(f"{folder} goes on: {there}", file=sys.stderr)
        print_outcome(run(cfg, folder, store), folder)
    finally:
        store.run_ended()


def print_outcome(result: Result, folder: Path) -> None:
    """Print the best candidate of a run, and why the run was stopped early, if it was.

    Raises:
        UserError: no candidate could be tried.
        KeyboardInterrupt: the run was interrupted.
    """
    if result.stopped == INTERRUPTED:
        raise KeyboardInterrupt(resume_hint(folder))
    if result.best is None and result.stopped is not None:
        raise UserError(f"no candidate could be tried: {result.stopped}; {resume_hint(folder)}")
    reasons = [e.reason for g in result.generations for e in g.evaluations]
    why = reasons[0] if reasons else "no candidate came"
    print_best(best_figures(result), folder, why, unseen_figures(result))
    if result.stopped is not None:
        say(f"stopped: {result.stopped}", resume_hint(folder), file=sys.stderr)


def print_best(best: dict[str, Any] | None, folder: Path, why: str = "", unseen: dict[str, Any] | None = None) -> None:
    """Print the best candidate and what it earned in unseen layouts, given as in ``result.json``.

    Raises:
        UserError: there is none.
    """
    if best is None:
        raise UserError(f"no candidate could be tried{why and f'; the first reason: {why}'}")
    figures = f"best reward {best['reward']:.3f}"
    if best["distance_m"] is not None:  # of joined plans it is not known
        figures += f", distance {best['distance_m']:.2f} m"
    if unseen is not None:
        figures += f", in {unseen['layouts']} unseen layouts mean {unseen['mean']:.3f}, worst {unseen['worst']:.3f}"
    say(f"{figures}, candidate {best['candidate']}", str(folder / "best"))


class Experiment:
    """A run, composed when it is created, and started by `run`.

    ``Experiment("budget.n_agent=2", task="BringCube", seed=1)``: positional arguments are the words of the command
    line. Config groups and top-level keys can be keyword arguments.

    Raises:
        UserError: a wrong choice, key or type; the message says what is possible.
    """

    def __init__(self, *overrides: str, **choices: Any) -> None:
        self.overrides = (*(f"{key}={hydra_word(value)}" for key, value in choices.items()), *overrides)
        self.config: DictConfig = load("config", self.overrides)
        self.result: Result | None = None
        self.folder: Path | None = None

    def run(self, folder: str | Path | None = None) -> Result:
        """Run in ``folder``, by default ``runs/<task>/<time>``, and leave there the files that the command leaves.

        Raises:
            UserError: a part or a setting is wrong, or the folder already holds a run or can't be written.
        """
        given = folder if folder is not None else new_folder(f"runs/{task_folder(self.config.task)}/{stamp()}")
        self.folder = Path(given)
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        self.result = run(self.config, self.folder)
        return self.result
