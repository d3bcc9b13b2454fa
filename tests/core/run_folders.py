"""Run folders made by the store itself, without a model or a simulator: what reports are made from."""

import json
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.design import Candidate, Component, Tool
from core.events import Generation, Result, Run
from core.geometry import Box, Pose
from core.interfaces import Brief, Budget, Message, Reply, Request, Text
from core.plugins import event_hub
from core.store.recorder import RunStore
from core.trial import Evaluation, Where
from plugins.actions.waypoints import WaypointActions
from plugins.conformance.evaluations import tried_once

PLAN = np.array([[0.5, 0.0, 0.4, 0.0, 0.0, 0.1], [0.6, 0.1, 0.3, 0.0, 0.0, 0.0]])

ALONG_X = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def hook(length: float, name: str = "hook", description: str = "") -> Tool:
    """A shaft of some length and a blade that joins it."""
    shaft = Component(
        "shaft",
        "tool_mount",
        Pose.xyz_rpy((0, 0, -length / 2)),
        Box((0.02, 0.02, length)),
    )
    blade = Component(
        "blade",
        "shaft",
        Pose.xyz_rpy((0.04, 0, -length / 2)),
        Box((0.1, 0.03, 0.006)),
    )
    return Tool((shaft, blade), name=name, description=description)


def write_run(
    folder: Path,
    *overrides: str,
    rewards=((0.2, 0.4), (0.5, 0.7)),
    distances=(1.5, 0.5),
    tools=None,
    finish: bool = True,
    name: str = "a way",
    cost_usd: float | None = None,
    unseen=None,
    stopped: str | None = None,
) -> Path:
    """A run of ``rewards`` by generation and candidate; a reward of None is a rejected candidate.

    Each candidate has a tool of its own, ``tools[i]`` or a longer hook each time; a tool that comes again has another
    plan. Without ``finish`` the run is left as a killed one leaves it, its store open (as `write_run.open`).
    """
    cfg = _composed(
        *(word for word in overrides if not word.startswith("seed="))
    ).copy()
    cfg.seed = next(
        (int(word[5:]) for word in overrides if word.startswith("seed=")), 0
    )
    config = OmegaConf.to_container(cfg, resolve=True)
    task, representation = (
        part("task", cfg.task).create(),
        part("tool", cfg.tool).create(),
    )
    budget = Budget(
        **{key: value for key, value in config["budget"].items() if key != "name"}
    )
    parts = {
        kind: config[kind]["name"]
        for kind in (
            "task",
            "robot",
            "sim",
            "vlm",
            "tool",
            "action",
            "evolution",
            "fitness",
            "executor",
        )
    }
    run = Run(folder, config, parts, "a can", task, representation, budget, cfg.seed)
    events = event_hub()
    store = RunStore.create(folder, config)
    events.register(store)
    events.hook.run_started(run=run)
    given = representation.given(task)
    where = Where(task.name, parts["sim"], cfg.seed)
    plans_of = Counter()
    generations = []
    elite = ()
    for index, row in enumerate(rewards):
        brief = Brief(
            task,
            cfg.seed,
            representation,
            False,
            1,
            1,
            generation=index,
            agent=0,
            seed=cfg.seed,
            actions=WaypointActions(),
        )
        request = Request(
            f"g{index}-a0", brief, (Message("user", (Text("?"),)),), {}, 1.0
        )
        events.hook.request_composed(request=request)
        reply = Reply(
            request.id,
            "{}",
            "a can",
            prompt_tokens=100,
            completion_tokens=10,
            cost_usd=cost_usd,
        )
        events.hook.reply_received(request=request, reply=reply)
        evaluations = []
        for i, reward in enumerate(row):
            tool = given or (
                tools[i % len(tools)] if tools else hook(0.2 + 0.05 * i + 0.01 * index)
            )
            plan = PLAN + 0.001 * plans_of[tool.content] * ALONG_X
            plans_of[tool.content] += 1
            if tool.gripper:
                plan = np.hstack([plan, np.zeros((2, 1))])
            candidate = Candidate(
                tool, plan, index, 0, i, 0, design_name=name, parents=elite
            )
            if reward is None:
                evaluations.append(
                    Evaluation(replace(candidate, problem="it is too heavy"))
                )
            else:
                distance_m = distances[i % len(distances)]
                evaluations.append(
                    tried_once(
                        candidate,
                        "ok",
                        reward=reward,
                        distance_m=distance_m,
                        where=where,
                    )
                )
            keep_trials(store, evaluations[-1])
            events.hook.candidate_evaluated(evaluation=evaluations[-1])
        generations.append(Generation(index, tuple(evaluations)))
        events.hook.generation_finished(generation=generations[-1])
        best = generations[-1].best
        if cfg.evolution.name == "vlmgineer" and best is not None:
            elite = (best.candidate.id,)
    if not finish:
        write_run.open.append(events)
        return folder
    events.hook.run_finished(
        run=run, result=Result(tuple(generations), 12.5, stopped, unseen=unseen or {})
    )
    events.hook.run_ended()
    return folder


write_run.open = []


def keep_trials(store: RunStore, evaluation: Evaluation) -> None:
    """Store the trials of an evaluation, as the scheduler does when they end."""
    for trial in (*evaluation.trials, *evaluation.finals.in_order()):
        store.keep_trial(
            (evaluation.candidate.of(trial.task).content, trial.where), trial
        )


@lru_cache(maxsize=64)
def _composed(*overrides: str):
    """Hydra takes its time."""
    return load("config", ["listener=[]", "second=[]", *overrides])


def result(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())


def edit(folder: Path, statement: str, *values) -> None:
    """Change a store by hand."""
    with closing(sqlite3.connect(folder / "run.sqlite")) as database:
        database.execute(statement, values)
        database.commit()
