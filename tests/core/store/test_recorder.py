"""What a run leaves in its store, and in what order it gets there."""

import json
import re
import sqlite3
from dataclasses import asdict, replace
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.errors import UserError
from core.events import Generation, Result, Run
from core.geometry import Box, Pose
from core.interfaces import Brief, Budget, Message, Picture, Reply, Request, Text
from core.plugins import event_hub, installed
from core.store.reader import StoredRun
from core.store.recorder import RunStore
from core.store.run_figures import summary, versions
from core.trial import Evaluation, Score, Tally, Trial, Where
from core.values.margins import Margin
from core.values.observations import Moved, Observation
from plugins.actions.waypoints import WaypointActions
from plugins.conformance.evaluations import tried_once
from tasks.bring_cube import BringCube
from tests.core.run_folders import keep_trials

ROD = Tool(
    (
        Component(
            "rod",
            "tool_mount",
            Pose.xyz_rpy((0.0, 0.0, -0.1)),
            Box((0.02, 0.02, 0.2)),
        ),
    ),
    name="rod",
)
PLAN = np.array([[0.5, 0.0, 0.4, 0.0, 0.0, 0.1]])
URDF = installed().create("tool", "urdf")


def request():
    brief = Brief(
        BringCube(),
        0,
        URDF,
        False,
        1,
        1,
        generation=0,
        agent=1,
        seed=5,
        actions=WaypointActions(),
    )
    parts = (Text("What is seen:"), Picture(b"png"))
    return Request("g0-a1", brief, (Message("user", parts),), {"type": "object"}, 0.75)


@pytest.fixture
def opened(tmp_path):
    budget = Budget(1, 1, 3, 0, 5, 0.6, name="quick")
    config = {"budget": asdict(budget)}
    store = RunStore.create(tmp_path / "run", config)
    events = event_hub()
    events.register(store)
    parts = {
        "task": "BringCube",
        "robot": "panda",
        "sim": "none",
        "vlm": "canned",
        "tool": "urdf",
        "action": "waypoints",
        "evolution": "vlmgineer",
        "fitness": "nominal",
    }
    run = Run(
        store.folder,
        config,
        parts,
        "a can",
        BringCube(),
        URDF,
        budget,
        7,
    )
    events.hook.run_started(run=run)
    yield store, events, run
    events.hook.run_ended()


def rows(store, query):
    with sqlite3.connect(store.folder / "run.sqlite") as database:
        return database.execute(query).fetchall()


def test_request_and_reply_are_on_disk_at_once(opened):
    store, events, _ = opened
    events.hook.request_composed(request=request())
    assert rows(store, "SELECT id, temperature FROM requests") == [("g0-a1", 0.75)]
    text = (store.folder / "requests" / "g0-a1.md").read_text()
    assert "What is seen:" in text
    assert "../scene.png" in text
    assert json.loads(
        (store.folder / "requests" / "g0-a1.schema.json").read_text()
    ) == {"type": "object"}
    reply = Reply("g0-a1", "{not json", "a model", prompt_tokens=7)
    events.hook.reply_received(request=request(), reply=reply)
    assert (store.folder / "replies" / "g0-a1.txt").read_text() == "{not json"
    assert rows(store, "SELECT model, text, prompt_tokens, cost_usd FROM replies") == [
        ("a model", "{not json", 7, None)
    ]


def test_evaluations_and_their_design_once(opened):
    store, events, _ = opened
    for action in range(3):
        candidate = Candidate(
            ROD, PLAN + action, 1, 2, 3, action, parents=("g0-a0-s0-p0",)
        )
        evaluation = tried_once(candidate, "ok", reward=0.25 * action, distance_m=1.0)
        keep_trials(store, evaluation)
        events.hook.candidate_evaluated(evaluation=evaluation)
    rejected = Candidate(None, np.zeros((0, 6)), 1, 2, 4, problem="no boxes")
    events.hook.candidate_evaluated(evaluation=Evaluation(rejected))
    found = rows(
        store,
        "SELECT candidate, status, reason, reward, distance_m, waypoints FROM evaluations ORDER BY rowid",
    )
    assert [row[:4] for row in found] == [
        ("g1-a2-s3-p0", "ok", "", 0.0),
        ("g1-a2-s3-p1", "ok", "", 0.25),
        ("g1-a2-s3-p2", "ok", "", 0.5),
        ("g1-a2-s4-p0", "rejected", "no boxes", 0.0),
    ]
    assert json.loads(found[0][5]) == PLAN.tolist()
    assert found[3][4] is None
    ((parents, design),) = rows(store, "SELECT parents, written FROM designs")
    assert json.loads(parents) == ["g0-a0-s0-p0"]
    assert URDF.parse(json.loads(design), gripper=False).components[0].shape == Box(
        (0.02, 0.02, 0.2)
    )


def test_result_and_generations(opened):
    store, events, run = opened
    candidates = [Candidate(ROD, PLAN, 0, 0, 0, action) for action in range(3)]
    generation = Generation(
        0,
        (
            tried_once(candidates[0], "ok", reward=0.5, distance_m=2.0),
            tried_once(candidates[1], "failed", reason="it blew up"),
            replace(
                tried_once(candidates[0], "ok", reward=0.1, distance_m=1.0),
                candidate=candidates[2],
            ),
        ),
    )
    events.hook.generation_finished(generation=generation)
    figures = asdict(summary(generation))
    assert figures == {
        "index": 0,
        "best_reward": 0.5,
        "mean_reward": pytest.approx(0.3),
        "n_candidates": 3,
        "n_rejected": 0,
        "n_failed": 1,
    }
    events.hook.run_finished(run=run, result=Result((generation,), 1.5))
    result = json.loads((store.folder / "result.json").read_text())
    assert result.pop("versions").keys() >= {"python", "vlmgineer", "numpy", "pin"}
    assert result == {
        "name": "",
        "task": "BringCube",
        "robot": "panda",
        "sim": "none",
        "vlm": "canned",
        "tool": "urdf",
        "action": "waypoints",
        "evolution": "vlmgineer",
        "fitness": "nominal",
        "material": "paper",
        "budget": "quick",
        "seed": 7,
        "best": {
            "reward": 0.5,
            "generation": 0,
            "candidate": "g0-a0-s0-p0",
            "solved": False,
            "margin": None,
            "reason": "",
            "torque": None,
            "second_engine": None,
            "making": None,
            "makeable": None,
            "measured": {"distance_m": 2.0},
        },
        "unseen": None,
        "effort": None,
        "finalists": {},
        "held": None,
        "perturbed": None,
        "tie": 0.005,
        "stopped": None,
        "generations": [figures],
        "n_evaluations": 3,
        "rollouts": 2,  # the last one shares the trial of the first
        "wall_time_s": 1.5,
        "rollouts_per_s": 1.333,
    }


def test_a_folder_holds_one_run(opened):
    store, events, _ = opened
    with pytest.raises(
        UserError,
        match=r"another process is at work on the run in .*run; wait for its end",
    ):
        RunStore.create(store.folder, {})
    events.hook.run_ended()
    with pytest.raises(
        UserError,
        match=r"already holds a run; go on with it with resume=.*run, or choose another",
    ):
        RunStore.create(store.folder, {})


def test_numbers_come_back_to_the_last_bit(opened):
    store, events, _ = opened
    seen = Observation(
        "tipped",
        "cube",
        left=("cube",),
        moved={"cube": Moved((0.1, 0.0, 1 / 3), (1.0, 0.0, 0.0), 20.0)},
    )
    trials = (
        Trial(
            Where("Task", "mujoco", 3),
            "g0-a0-s0-p0",
            reward=1 / 3,
            measured={
                "distance_m": np.float64(1) / 3,
                "ik_error_m": np.float32(0.1),
                "ik_error_rad": 5e-324,
                "motion_s": 1 / 7,
            },
            moved_m={"cube": 1 / 7},
            warnings=("a", "b"),
            margins=(Margin("x", 1 / 3, 1, "m", 2 / 3),),
            touch_m=1 / 9,
            observation=seen,
            figures={"width_m": 1 / 3},
        ),
        Trial(
            Where("Task", "a", 4, 1),
            status="failed",
            reason="no",
            goals=(("door", 1 / 3), ("can", 0.0)),
        ),
    )
    finals = Tally({0: (Trial(Where("Task", "mujoco", 5), reward=1 / 7),)})
    score = Score(0.1 + 0.2, {"x": 1 / 9}, 1, ("it is wide",), "it is too wide")
    candidate = Candidate(ROD, PLAN)
    stored = Evaluation(candidate, trials, score)
    keep_trials(store, replace(stored, finals=finals))
    events.hook.candidate_evaluated(evaluation=stored)
    events.hook.finalist_tried(evaluation=replace(stored, finals=finals))
    events.hook.run_ended()

    (back,) = StoredRun(store.folder).evaluations()
    for read, tried in zip(
        [*back.trials, *back.finals], [*trials, *finals.in_order()], strict=True
    ):
        np.testing.assert_equal(vars(read), vars(tried))  # nan is nan there
    assert back.score == score
    again = back.of(candidate)
    assert (again.candidate, again.reward, again.reason) == (
        candidate,
        0.1 + 0.2,
        "it is too wide",
    )
    assert again.trials[0].figure("ik_error_m") == float(np.float32(0.1))
    assert again.distance_m == stored.distance_m == 1 / 3


def test_a_trial_is_stored_when_it_ends_and_is_known_when_the_run_goes_on(opened):
    store, events, _ = opened
    key = Candidate(ROD, PLAN).content, Where("Task", "mujoco", 3)
    trial = Trial(key[1], "g0-a0-s0-p0", reward=0.1 + 0.2)
    store.keep_trial(key, trial)
    assert rows(
        store,
        "SELECT number, content, task, engine, layout, change, reward FROM trials",
    ) == [(1, key[0], "Task", "mujoco", 3, None, 0.1 + 0.2)]
    events.hook.run_ended()

    again = RunStore.open(store.folder)
    again.run_ended()
    assert str(again.past.trials) == str({key: trial})  # nan is not nan
    assert again.past.candidates == {}  # it lacks its other trials


def test_versions_name_every_installed_requirement():
    found = versions()
    declared = (Path(__file__).parents[3] / "pyproject.toml").read_text()
    names = {
        name
        for name in re.findall(r'"([A-Za-z][\w.-]*)[^"\n]*[><=]=', declared)
        if name != "hatchling"
    }
    assert {"jinja2", "manifold3d", "numpy"} < names
    installed = {distribution.name.lower() for distribution in metadata.distributions()}
    for name in names & installed:
        assert found[name] == metadata.version(name)
    assert found.keys() >= {"python", "vlmgineer"}
