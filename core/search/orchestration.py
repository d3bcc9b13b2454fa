"""A whole run: a config in, a run folder out. The parts are made, the loop runs, and what is left is written; or a run
that was cut short goes on. ``python -m core.run`` is this, from a command line.
"""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from core.config.compose import check_seed, node, part
from core.config.resume import changed, hydra_config
from core.config.schemas import PromptConfig
from core.config.settings import Sampling
from core.designs.composer import PromptComposer
from core.errors import UsageError, UserError
from core.events import INTERRUPTED, Result, Run
from core.interfaces import Budget, Executor, RolloutSettings, Simulator
from core.plugins import event_hub, installed
from core.plugins.blame import describe_failure
from core.search.designer import DEFAULT_KINDS, make_designer
from core.search.evolution import evolve
from core.search.listeners import add_listener
from core.simulation.pictures import report_missing, save_film
from core.simulation.rollout import Evaluator
from core.store.artifacts import save_design
from core.store.database import writing
from core.store.progress import CachedVLM
from core.store.recorder import RunStore, best_figures


def run(cfg: DictConfig, folder: Path, store: RunStore | None = None) -> Result:
    """Make the parts that ``cfg`` names, run the loop, and leave everything in ``folder``; ``store`` is that of a run
    which goes on there.

    Raises:
        UserError: a part or setting that can't be had, or a folder that holds a run already or can't be written.
        KeyboardInterrupt: during anything but the loop (`Result.stopped`); says how to go on.
    """
    config = cast(dict[str, Any], OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True))
    budget = Budget(**{field.name: config["budget"][field.name] for field in fields(Budget)})
    check_budget(budget)
    check_seed(cfg.seed)
    task_part, sim_part = part("task", cfg.task), part("sim", cfg.sim)
    task, simulator = task_part.create(), sim_part.create()
    vlm = part("vlm", cfg.vlm).create()
    representation = part("tool", cfg.tool).create()
    given = representation.given(task)
    if given is not None:
        budget = replace(budget, n_tool=1)
    settings = node(cfg.rollout, RolloutSettings)
    evaluator = Evaluator(task_part, sim_part, cfg.seed, settings)
    fitness = part("fitness", cfg.fitness).create(evaluator=evaluator)

    executor: Executor = part("executor", cfg.executor).create()
    prompts = PromptComposer(node(cfg.prompt, PromptConfig), settings)
    events = event_hub()
    designer = make_designer(
        task,
        simulator,
        CachedVLM(vlm, store.past.replies) if store is not None else vlm,
        representation,
        prompts,
        budget,
        seed=cfg.seed,
        sampling=node(cfg.sampling, Sampling),
        tool_kinds=config["task"].get("tool_kinds") or DEFAULT_KINDS,
        events=events,
    )
    strategy = part("evolution", cfg.evolution).create(designer=designer, budget=budget)
    for name, options in config["listener"].items():
        add_listener(events, installed().create("listener", name, options or {}), name)
    store = store or RunStore.create(folder, config)  # from here on the folder is this run's
    events.register(store, "store")  # what it raises ends the run: no reply and no evaluation may be lost
    add_listener(events, vlm, "vlm")
    parts = {kind: config[kind]["name"] for kind in ("task", "sim", "vlm", "tool", "evolution", "fitness", "executor")}
    this = Run(folder, config, parts, vlm.model, task, representation, budget, cfg.seed, simulator, settings)
    try:
        with writing(folder):
            if designer.picture is not None:
                (folder / "scene.png").write_bytes(designer.picture.png)
        events.hook.run_started(run=this)
        with executor:
            result = evolve(strategy, fitness, executor, budget, events, store.past.evaluation)
        result = replace(result, wall_time_s=store.seconds + result.wall_time_s)
        with writing(folder):
            save_best(result, this, simulator, settings, film=cfg.film)
        events.hook.run_finished(run=this, result=result)
    except UserError as error:
        raise UserError(f"{error}; {to_go_on(folder)}") from error
    except KeyboardInterrupt:
        raise KeyboardInterrupt(to_go_on(folder)) from None
    except Exception as error:
        blamed = describe_failure(error)
        if blamed is not None:
            error.add_note(blamed)
        error.add_note(to_go_on(folder))
        raise
    finally:
        events.hook.run_ended()
    return result


def save_best(result: Result, this: Run, simulator: Simulator, settings: RolloutSettings, *, film: bool) -> None:
    """What a person takes away, in ``best/``; a film of it unless there is no time for one."""
    best, folder = result.best, this.folder / "best"
    if best is None:
        return
    shutil.rmtree(folder, ignore_errors=True)  # of a run that went on, the best so far
    save_design(best.candidate, this.representation, folder)
    if film and result.stopped != INTERRUPTED:
        try:
            save_film(this.task, simulator, best.candidate, this.seed, settings, folder / "rollout.gif")
        except Exception as error:  # a film that fails costs the film, never the run
            report_missing("film", error)


def to_go_on(folder: Path) -> str:
    """What to type."""
    return f"to go on: python -m core.run resume={shlex.quote(str(folder))}"


def resume(folder: Path, overrides: Sequence[str] = ()) -> None:
    """Go on with the run in ``folder``, and say what it came to.

    Raises:
        UserError: there is none, its store can't be used, or ``overrides`` change what can't be changed.
    """
    store = RunStore.open(folder)
    if store is None:
        tell(run(changed(hydra_config(folder), overrides), folder), folder)
        return
    try:
        cfg = changed(store.config, overrides)
        ended, before = store.result, store.config["budget"]
        more = any(cfg.budget[key] != before[key] for key in ("n_iteration", "stop_reward"))
        if ended is not None and ended["stopped"] is None and not more:
            sys.stdout.write(f"{folder} holds a run that has come to its end\n")
            tell_best(ended["best"], folder)
            return
        store.overrides = overrides
        there = f"{len(store.past.replies)} replies and {len(store.past.candidates)} evaluated candidates are there"
        sys.stderr.write(f"{folder} goes on: {there}\n")
        tell(run(cfg, folder, store), folder)
    finally:
        store.run_ended()


def tell(result: Result, folder: Path) -> None:
    """Say what a run came to.

    Raises:
        UserError: to nothing.
        KeyboardInterrupt: it was interrupted.
    """
    if result.stopped == INTERRUPTED:
        raise KeyboardInterrupt(to_go_on(folder))
    if result.best is None and result.stopped is not None:
        raise UserError(f"no candidate could be tried: {result.stopped}; {to_go_on(folder)}")
    reasons = [e.reason for g in result.generations for e in g.evaluations]
    tell_best(best_figures(result), folder, reasons[0] if reasons else "no candidate came")
    if result.stopped is not None:
        sys.stderr.write(f"stopped: {result.stopped}\n{to_go_on(folder)}\n")


def tell_best(best: dict[str, Any] | None, folder: Path, why: str = "") -> None:
    """The best candidate, as in ``result.json``.

    Raises:
        UserError: there is none.
    """
    if best is None:
        raise UserError(f"no candidate could be tried{why and f'; the first reason: {why}'}")
    sys.stdout.write(f"best reward {best['reward']:.3f}, distance {best['distance_m']:.2f} m, ")
    sys.stdout.write(f"candidate {best['candidate']}\n{folder / 'best'}\n")


def check_budget(budget: Budget) -> None:
    """Refuse counts that make no population.

    Raises:
        UsageError: says which.
    """
    for name, least in (("n_agent", 1), ("n_tool", 1), ("n_action", 1), ("k_top", 1), ("n_iteration", 0)):
        if getattr(budget, name) < least:
            raise UsageError(f"budget.{name} must be at least {least}, got {getattr(budget, name)}")
