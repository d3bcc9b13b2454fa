"""``python -m core.run``: a config in, a run folder out. Thin: it makes the parts, runs the loop, and writes what is
left.
"""

from __future__ import annotations

import os
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.artifacts import save_design, save_film
from core.cli import command
from core.config import PromptConfig, check_seed, explain, node, part, register
from core.designer import DEFAULT_KINDS, Sampling, make_designer
from core.errors import UsageError, UserError
from core.evolution import evolve
from core.fitness import fitness
from core.interfaces import Budget, Executor, RolloutSettings
from core.plugins import event_hub, installed
from core.prompts import Prompts
from core.record import Result, Run
from core.rollout import Bench
from core.store import RunStore


def run(cfg: DictConfig, folder: Path) -> Result:
    """Make the parts that ``cfg`` names, run the loop, and leave everything in ``folder``.

    Raises:
        UserError: a part or setting that can't be had, or a folder that holds a run already.
    """
    config = cast(dict[str, Any], OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True))
    budget = Budget(**{field.name: config["budget"][field.name] for field in fields(Budget)})
    check_budget(budget)
    check_seed(cfg.seed)
    task_part, sim_part = part("task", cfg.task, without=("tool_kinds", "paper")), part("sim", cfg.sim)
    task, simulator = task_part.create(), sim_part.create()
    vlm = part("vlm", cfg.vlm).create()
    representation = part("tool", cfg.tool).create()
    given = representation.given(task)
    if given is not None:
        budget = replace(budget, n_tool=1)
    settings = node(cfg.rollout, RolloutSettings)
    earns = fitness(config["fitness"], Bench(task_part, sim_part, cfg.seed, settings))

    executor: Executor = part("executor", cfg.executor).create()
    prompts = Prompts(node(cfg.prompt, PromptConfig), settings)
    events = event_hub()
    designer = make_designer(
        task,
        simulator,
        vlm,
        representation,
        prompts,
        budget,
        seed=cfg.seed,
        sampling=node(cfg.sampling, Sampling),
        tool_kinds=config["task"].get("tool_kinds") or DEFAULT_KINDS,
        events=events,
    )
    strategy = part("evolution", cfg.evolution).create(designer=designer, budget=budget)
    for name, options in config["logger"].items():
        events.register(installed().create("logger", name, options or {}), name)
    events.register(RunStore(folder), "store")  # from here on the folder is this run's
    events.register(vlm, "vlm")
    assert designer.picture is not None
    (folder / "scene.png").write_bytes(designer.picture.png)
    parts = {kind: config[kind]["name"] for kind in ("task", "sim", "vlm", "tool", "evolution", "fitness", "executor")}
    this = Run(folder, config, parts, vlm.model, task, representation, budget, cfg.seed, simulator, settings)
    try:
        events.hook.run_started(run=this)
        with executor:
            result = evolve(strategy, earns, executor, budget, events)
        if result.best is not None:
            best = result.best.candidate
            save_design(best, representation, folder / "best")
            if cfg.film:
                save_film(task, simulator, best, cfg.seed, settings, folder / "best" / "rollout.gif")
        events.hook.run_finished(run=this, result=result)
    finally:
        events.hook.run_ended()
    return result


def check_budget(budget: Budget) -> None:
    """Refuse counts that make no population.

    Raises:
        UsageError: says which.
    """
    for name, least in (("n_agent", 1), ("n_tool", 1), ("n_action", 1), ("k_top", 1), ("n_iteration", 0)):
        if getattr(budget, name) < least:
            raise UsageError(f"budget.{name} must be at least {least}, got {getattr(budget, name)}")


_failures: list[UserError] = []  # of the jobs; raised in a job, Hydra would print lines of its own around them


@hydra.main(version_base="1.3", config_path="pkg://conf", config_name="config")  # type: ignore[untyped-decorator]
def _job(cfg: DictConfig) -> None:
    folder = Path(HydraConfig.get().runtime.output_dir)
    try:
        result = run(cfg, folder)
    except UserError as error:
        _failures.append(error)
        return
    best = result.best
    if best is None:
        reasons = [e.reason for g in result.generations for e in g.evaluations]
        why = reasons[0] if reasons else "no candidate came"
        _failures.append(UserError(f"no candidate could be tried; the first reason: {why}"))
        return
    sys.stdout.write(
        f"best reward {best.reward:.3f}, distance {best.distance_m:.2f} m, candidate {best.candidate.id}\n"
    )
    sys.stdout.write(f"{folder / 'best'}\n")


def main() -> None:
    register()
    os.environ["HYDRA_FULL_ERROR"] = "1"  # let Hydra's errors through; they are told in one line here
    try:
        _job()
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error, "config", [a for a in sys.argv[1:] if not a.startswith("-")]) from error
    if _failures:
        raise _failures[0]


if __name__ == "__main__":
    command(main)
