"""Run a search from a configuration, or resume one: what ``python -m core.run`` does."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig

from core.config.gate import note_typed, take_stored
from core.config.own_copies import keep_inputs
from core.config.resume import changed, refuse_other_run
from core.config.sources import explain_stand_in
from core.errors import RAISED, UserError, fault
from core.events import INTERRUPTED, Result
from core.plugins import SIMULATOR, installed
from core.plugins.blame import describe_failure
from core.search.evolution import evolve
from core.search.finalists import Race, choose_winner, rollouts_in
from core.search.makers import Judge
from core.search.outcome import Announcer, print_best, report_end, resume_hint
from core.search.patience import run_patiently
from core.search.second_engine import check_engines, try_second_engine
from core.search.setup import Search, build_search
from core.search.trials import Trials
from core.store.database import FILE
from core.store.reader import StoredRun
from core.store.recorder import RunStore
from core.support.cli import say
from core.support.files import writing
from core.support.interrupts import resumable


def run_and_print(
    cfg: DictConfig, folder: Path, store: RunStore | None = None
) -> float:
    """Do what `run` does, with patience (`core.search.patience`), and print the outcome.

    Returns:
        The best reward.

    Raises:
        UserError: see `run`; or no candidate could be tried.
        KeyboardInterrupt: the run was interrupted.
    """
    result = run_patiently(
        lambda opened: run(cfg, folder, opened, [Announcer()]),
        folder,
        store,
        cfg.patience_s,
    )
    report_end(result, folder)
    assert result.best is not None
    return result.best.reward


def run_job(cfg: DictConfig, folder: Path) -> float:
    """Do what `run_and_print` does for a job of a sweep, and go on with it where it was begun before.

    So a sweep may be started again, by its user or by a cluster that ended a job early.

    Returns:
        The best reward, which a sweeper may optimise.

    Raises:
        UserError: see `run`; or the folder holds a run of other settings.
    """
    store = RunStore.open(folder)
    if store is None:
        return run_and_print(cfg, folder)

    try:
        refuse_other_run(store.config, cfg, folder)
        return _go_on(store, folder, cfg)
    finally:
        store.run_ended()


def run(
    cfg: DictConfig,
    folder: Path,
    store: RunStore | None = None,
    listeners: Sequence[object] = (),
) -> Result:
    """Make the parts that ``cfg`` names, run the loop, and leave everything in ``folder``.

    ``store`` is the store of the run in ``folder`` that is resumed; None: a new run. ``listeners`` hear of it beside
    those of ``cfg``, and before them.

    Raises:
        UserError: a part or setting that can't be used, or a folder that holds a run already or can't be written.
        KeyboardInterrupt: outside of the loop (inside: `Result.stopped`); says how to go on.
    """
    check_engines(cfg.second)
    search = build_search(cfg, folder, store.past.replies if store is not None else {})
    # From here on the folder is this run's.
    if store is None:
        store = RunStore.create(folder, search.run.config)
        keep_inputs(folder, cfg)
    note_typed(search.run.config)
    # Registered last it is called first, and what it raises ends the run: no reply and no evaluation may be lost.
    for listener in listeners:
        search.events.register(listener)
    search.events.register(store, "store")
    hint = resume_hint(folder)
    stand_in = explain_stand_in(str(SIMULATOR), cfg.sim.name)
    if stand_in:
        say(stand_in, file=sys.stderr)

    try:
        with resumable(hint):
            return run_search(search, store)
    except BrokenPipeError:  # who reads what is printed is gone
        raise
    except UserError as error:
        raise UserError(f"{error}; {hint}") from error
    except RAISED as error:
        blamed = describe_failure(error)
        machine = fault(error)
        # A plugin that exits would end the command with status 0.
        if machine is not None or isinstance(error, SystemExit):
            raise UserError(f"{blamed or machine or error}; {hint}") from error
        if blamed:
            error.add_note(blamed)
        error.add_note(hint)
        raise
    finally:
        search.events.hook.run_ended()


def run_search(search: Search, store: RunStore) -> Result:
    """Run the loop, and write what it found."""
    run = search.run
    events = search.events
    events.hook.run_started(run=run)

    judge = None
    if run.budget.final_s > 0:
        judge = Judge(run, search.fitness.conditions())

    with search.executor:
        trials = Trials(search.executor, store.keep_trial, store.past.trials)
        search.strategy.trials = trials
        race = Race(
            iter(search.fitness.finals()),
            search.fitness,
            trials,
            search.strategy.tie,
            judge=judge,
            tell=lambda runner: events.hook.finalist_tried(evaluation=runner),
        )
        result = evolve(
            search.strategy,
            race,
            run.budget,
            events,
            run.task.robot,
            store.past.expect,
            rollouts_in(search.fitness, run.budget.elite_s),
            store.past.generations,
        )
        if result.best is not None and result.stopped != INTERRUPTED:
            result = choose_winner(result, race, run.budget.final_s)

    if result.best is not None and result.stopped != INTERRUPTED:
        second_engine = try_second_engine(run, result, run.config["second"])
        result = replace(result, second_engine=second_engine)

    result = replace(result, wall_time_s=store.seconds + result.wall_time_s)
    with writing(run.folder):
        for export in installed().factories("export").values():
            export(result, run, search.strategy)

    memory = search.designer.memory
    if memory is not None and result.best is not None and result.stopped is None:
        memory.learn(result, run.folder)

    events.hook.run_finished(run=run, result=result)
    return result


def resume(folder: Path, overrides: Sequence[str] = ()) -> None:
    """Go on with the run in ``folder``, and print its outcome.

    Raises:
        UserError: there is no run, its store can't be used, or ``overrides`` change what can't be changed.
    """
    store = RunStore.open(folder)
    if store is None:
        inside = sorted(store.parent for store in folder.glob(f"*/{FILE}"))
        hint = f"there is one in {inside[0]}" if inside else "start one"
        raise UserError(f"{folder} holds no run that has begun; {hint}")

    try:
        config, left = store.config, list(overrides)
        if overrides or store.result is None or store.result.stopped is not None:
            config, left = take_stored(config, folder, overrides)
        cfg = changed(config, left)
        _go_on(store, folder, cfg)
    finally:
        store.run_ended()


def _has_ended(store: RunStore, cfg: DictConfig) -> bool:
    """Report whether a stored run has come to its end, and ``cfg`` asks for no more."""
    more = any(cfg[key] != store.config[key] for key in ("budget", "evolution"))
    ended = store.result is not None and store.result.stopped is None
    return ended and not more


def _go_on(store: RunStore, folder: Path, cfg: DictConfig) -> float:
    """Go on with a run whose store is open, or print again what it came to.

    Returns:
        The best reward.

    Raises:
        UserError: see `run_and_print`.
    """
    if store.result is not None and _has_ended(store, cfg):
        say(f"{folder} holds a run that has come to its end")
        false = StoredRun(folder).find_false_claim()
        if false:
            raise UserError(f"{folder}: {false}")
        if store.result.best is None:
            raise UserError("no candidate could be tried")
        print_best(store.result.best, folder)
        return store.result.best.reward

    past = store.past
    there = f"{len(past.replies)} replies and {len(past.candidates)} evaluated candidates are there"
    if past.again:
        there += f"; {len(past.again)} requests without an answer are sent again"
    say(f"{folder} goes on: {there}", file=sys.stderr)
    if cfg.budget.stop_reward != store.config["budget"].get("stop_reward"):
        say(
            f"budget.stop_reward: the {past.generations} generations in which something was tried stay; it can end the "
            "run after them",
            file=sys.stderr,
        )
    return run_and_print(cfg, folder, store)
