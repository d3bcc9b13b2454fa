"""A recording is read back by Rerun's own reader."""

import os
import re
import subprocess
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from core.config.compose import load
from core.design import Candidate, Tool
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError
from core.events import Generation, Result, Run
from core.interfaces import Budget
from core.plugins import event_hub, installed
from plugins.actions.anchored import AnchoredActions
from plugins.conformance.evaluations import tried_once
from plugins.listeners.rerun.blueprint import MAX_TEXT
from plugins.listeners.rerun.writer import replay
from tests.support import solutions
from tests.support.panda import ARM
from tests.support.playing import evaluate_batch

pytestmark = pytest.mark.slow

SOLUTION = Path(__file__).parents[2] / "tasks" / "solutions" / "BringCube.json"
TASK = installed().create("task", "BringCube")
URDF = installed().create("tool", "urdf")
HOSTILE = (
    "hook\x00\x1b[31m\u202egnitset\u200b\ud800 ![look](http://evil.example/x.png) <img src=x>\r"
    "generation 9, rank 1\u2028candidate g9-a9-s9-p9, reward 1.000\n" + "x" * 50_000
)


@pytest.fixture(scope="module")
def simulator():
    return installed().create("sim", "pybullet")


@pytest.fixture(scope="module")
def generations(simulator):
    """One with a hook and a reject; the same hook in a hostile model's words; a bare hand that derives from both, and
    stays where it is.
    """
    hook = replace(read_designs(load_designs(SOLUTION), URDF, TASK)[0], action=0)
    hostile = replace(
        hook,
        tool=replace(hook.tool, name=HOSTILE, description=HOSTILE),
        plan=hook.plan.poses[:2],
        design=1,
        design_name=HOSTILE,
        design_description=HOSTILE,
        action_description=HOSTILE,
    )
    lost = Candidate(None, np.zeros((0, 6)), 0, 2, problem="no boxes")
    parents = (hook.id, hostile.id)
    hand = Candidate(
        Tool(gripper=True), np.array([[0.5, 0, 0.5, 0, 0, 0, 1.0]]), 1, parents=parents
    )
    rounds = ([hook, lost], [hostile], [hand])
    tried = [evaluate_batch(TASK, simulator, candidates) for candidates in rounds]
    return tuple(
        Generation(i, tuple(evaluations)) for i, evaluations in enumerate(tried)
    )


def run_in(folder, simulator):
    parts = {"task": "BringCube", "sim": "pybullet", "vlm": "canned"}
    return Run(
        folder,
        {},
        parts,
        "canned",
        TASK,
        URDF,
        Budget(1, 2, 1, 1, 3, 0.6),
        0,
        simulator,
    )


def play(run, generations, **settings):
    """The generations that a listener receives."""
    hub = event_hub()
    hub.register(installed().create("listener", "rerun", settings))
    hub.hook.run_started(run=run)
    for generation in generations:
        hub.hook.generation_finished(generation=generation)
    hub.hook.run_finished(run=run, result=Result(tuple(generations), 1.0))
    hub.hook.run_ended()


class Recording:
    """Rows by entity path in the order of writing, static ones apart; ``sim_time`` in seconds."""

    def __init__(self, file):
        self.rows: dict[str, list[dict]] = defaultdict(list)
        self.static: dict[str, list[dict]] = defaultdict(list)
        reader = RrdReader(file)
        for chunk in reader.stream().to_chunks():
            table = pa.Table.from_batches([chunk.to_record_batch()])
            if "sim_time" in table.column_names:
                k = table.column_names.index("sim_time")
                table = table.set_column(
                    k, "sim_time", table["sim_time"].cast(pa.int64())
                )
            names = [name.split(":")[-1] for name in table.column_names]
            (self.static if chunk.is_static else self.rows)[chunk.entity_path] += [
                dict(zip(names, row.values(), strict=True)) for row in table.to_pylist()
            ]
        for rows in self.rows.values():
            rows.sort(key=lambda row: row.pop("rerun.controls.RowId"))
            for row in rows:
                row["sim_time"] = row["sim_time"] / 1e9
        arranged = [
            chunk.format(width=400)
            for b in reader.blueprints()
            for chunk in reader.stream(store=b)
        ]
        self.blueprint = "\n".join(arranged)

    def column(self, path, name):
        """None where a row lacks it."""
        return [row.get(name) for row in self.rows[path]]

    def values(self, path, name):
        """Of components that are logged one by one."""
        return [value for (value,) in self.column(path, name)]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, simulator, generations):
    folder = tmp_path_factory.mktemp("run")
    play(run_in(folder, simulator), generations)
    return Recording(folder / "recording.rrd"), folder / "recording.rrd"


def test_on_by_default():
    cfg = load("config", [])
    assert dict(cfg.listener.rerun) == {"hz": 25.0}
    assert "progress" in cfg.listener


def test_the_arm_the_tool_and_the_scene_move(recorded, generations):
    recording, _ = recorded
    solved = generations[0].best.candidate
    links = [f"/world/robot/panda_link{k}" for k in range(9)]
    for link in links[:8]:
        assert sum("vertex_positions" in row for row in recording.static[link]) == 1
    times = recording.column("/world/robot/tool_mount", "sim_time")
    assert times == sorted(times)
    for path in (*links, "/world/scene/cube"):
        assert recording.column(path, "sim_time") == times
        numbers = recording.column(path, "generation")
        assert sorted(set(numbers)) == [0, 1, 2]
        assert numbers == sorted(numbers)
    assert 0.03 < np.median(np.diff(times)) < 0.05  # 25 frames a second

    # A pause lies between rollouts.
    starts = np.flatnonzero(np.diff(times, prepend=-1.0) > 0.4)
    assert len(starts) == 3
    last = starts[1] - 1
    assert recording.column(f"/reward/{solved.id}", "sim_time")[-1] == times[last]
    (place,) = recording.column("/world/robot/tool_mount", "translation")[last]
    assert np.allclose(place, solved.plan.poses[-1, :3], atol=0.01)
    (cube,) = recording.column("/world/scene/cube", "translation")[last]
    assert np.allclose(cube[:2], (0.6, 0.0), atol=0.05)
    (home,) = recording.column("/world/robot/tool_mount", "translation")[starts[1]]
    assert np.allclose(home, TASK.home.position, atol=0.01)


def test_the_tool_is_mounted_for_its_rollout_and_the_hand_for_its_own(
    recorded, generations
):
    recording, _ = recorded
    solved = generations[0].best.candidate
    tool = "/world/robot/tool_mount/tool"
    assert recording.column(tool, "generation") == [0, 1, 2]
    shown = recording.column(tool, "vertex_positions")
    assert [bool(vertices) for vertices in shown] == [True, True, False]
    assert recording.column(tool, "is_recursive")[2] == [True]  # taken off
    low, high = np.min(shown[0], axis=0), np.max(shown[0], axis=0)
    placed = solved.tool.placed()
    corners = [
        placed[c.name][1].apply(c.shape.to_trimesh().vertices)
        for c in solved.tool.components
    ]
    assert np.allclose(low, np.min(np.concatenate(corners), axis=0), atol=1e-6)
    assert np.allclose(high, np.max(np.concatenate(corners), axis=0), atol=1e-6)
    for finger in ("panda_hand", "left_finger", "right_finger"):
        meshes = [
            row["generation"]
            for row in recording.rows[f"/world/robot/{finger}"]
            if row.get("vertex_positions")
        ]
        assert meshes == [2]


def test_the_path_is_the_way_of_the_end_effector(recorded):
    recording, _ = recorded
    strips = [strip for (strip,) in recording.column("/world/path", "strips")]
    assert len(strips) == 3
    places = [
        place for (place,) in recording.column("/world/robot/tool_mount", "translation")
    ]
    assert np.allclose(np.concatenate(strips), places, atol=1e-5)
    assert np.allclose(
        strips[0][0], ARM.forward(ARM.home_for(TASK.home)).position, atol=1e-3
    )


def test_the_reward_in_the_rollout_ends_at_what_was_earned(recorded, generations):
    recording, _ = recorded
    for evaluation in (
        e for g in generations for e in g.evaluations if e.status == "ok"
    ):
        course = recording.values(f"/reward/{evaluation.candidate.id}", "scalars")
        assert course[-1] == pytest.approx(evaluation.reward, abs=1e-9)
        assert course[0] == pytest.approx(0.0, abs=0.01)
        assert len(course) > 20
    assert generations[0].best.reward > 0.95


def test_what_a_generation_came_to(recorded, generations):
    recording, _ = recorded
    rewards = [
        [e.reward for e in g.evaluations if e.status == "ok"] for g in generations
    ]
    assert recording.column("/search/reward/best", "generation") == [0, 1, 2]
    assert recording.values("/search/reward/best", "scalars") == [
        max(r) for r in rewards
    ]
    assert recording.values("/search/reward/mean", "scalars") == pytest.approx(
        [np.mean(r) for r in rewards]
    )


def test_what_belongs_to_a_generation_is_there_while_it_is_shown(recorded):
    recording, _ = recorded
    moving = recording.rows["/world/robot/tool_mount"]
    begins = {
        g: min(row["sim_time"] for row in moving if row["generation"] == g)
        for g in (0, 1, 2)
    }
    for path in ("/search/reward/best", "/text/design"):
        found = {row["generation"]: row["sim_time"] for row in recording.rows[path]}
        assert found == pytest.approx(begins)


def test_a_models_words_are_plain_text_that_can_fake_nothing(recorded, generations):
    recording, _ = recorded
    shown = recording.values("/text/design", "text")
    assert set(map(tuple, recording.column("/text/design", "media_type"))) == {
        ("text/plain",)
    }
    assert f"a crossover of {generations[0].best.candidate.id} and " in shown[-1]
    assert any("http://evil.example" in text for text in shown)
    for text in shown:
        assert len(text) < 8 * MAX_TEXT
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u200b\u202e\u2028]", text)
        for line in text.splitlines():
            assert not line.startswith(("generation 9", "candidate g9"))
    assert "evil" not in recording.blueprint
    assert not any("evil" in path or "hook" in path for path in recording.rows)


def test_it_opens_arranged(recorded):
    recording, _ = recorded
    for view in ("rollout", "design", "reward by generation"):
        assert view in recording.blueprint
    assert "sim_time" in recording.blueprint


# --- failures ---------------------------------------------------------------------------------------------------


def said(capfd):
    """By us: in a run Rerun itself says nothing, but here it was imported by others before."""
    return [
        line
        for line in capfd.readouterr().err.splitlines()
        if line.startswith("rerun: ")
    ]


def test_no_rerun(tmp_path, simulator, generations, monkeypatch, capfd):
    for name in [
        name
        for name in sys.modules
        if name.split(".")[0] == "rerun" or "listeners.rerun." in name
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rerun", None)
    play(run_in(tmp_path, simulator), generations)
    assert said(capfd) == [
        "rerun: no recording from here on: Rerun is not installed (pip install rerun-sdk)"
    ]


def test_a_file_that_can_not_be_written(tmp_path, simulator, generations, capfd):
    (tmp_path / "recording.rrd").mkdir()
    play(run_in(tmp_path, simulator), generations)
    (line,) = said(capfd)
    assert line.startswith("rerun: ")
    assert "Is a directory" in line


FULL_DISK = """
import resource, sys
from pathlib import Path
from core.interfaces import Budget
from core.plugins import installed
from core.events import Run
from plugins.listeners.rerun import writer
writer._FLUSH_S = 2.0  # Rerun may or may not notice by itself
writer._END_S = 0.5
task, urdf = installed().create("task", "BringCube"), installed().create("tool", "urdf")
listener = installed().create("listener", "rerun")
resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
listener.run_started(Run(Path(sys.argv[1]), {}, {}, "canned", task, urdf, Budget(1, 2, 1, 1, 3, 0.6), 0))
listener.run_ended()
print("the run goes on")
"""


@pytest.mark.thorough
def test_a_full_disk(tmp_path):
    words = [sys.executable, "-c", FULL_DISK, str(tmp_path)]
    quiet = os.environ | {"RUST_LOG": "off"}
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, env=quiet)
    assert done.stdout == "the run goes on\n"
    (line,) = done.stderr.splitlines()
    assert line.startswith("rerun: no recording from here on: ")


def test_a_rollout_that_breaks_is_reported_in_its_place(tmp_path, generations, capfd):
    play(run_in(tmp_path, None), generations)
    recording = Recording(tmp_path / "recording.rrd")
    assert (
        "the rollout can't be shown: the run has no simulator"
        in recording.values("/text/design", "text")[0]
    )
    assert len(recording.values("/search/reward/best", "scalars")) == 3
    assert said(capfd) == []


def test_a_generation_of_rejects_only(tmp_path, simulator, capfd):
    lost = tried_once(
        Candidate(None, np.zeros((0, 6)), problem="no boxes"),
        "rejected",
        reason="no boxes",
    )
    play(run_in(tmp_path, simulator), [Generation(0, (lost,))])
    recording = Recording(tmp_path / "recording.rrd")
    assert "/search/reward/best" not in recording.rows
    assert said(capfd) == []


def test_a_mark_shows_where_a_guard_ended_until_the_next_rollout(
    tmp_path, simulator, generations
):
    hook = generations[0].evaluations[0]
    steps = [{"offset": [0.5, 0.3, 0.5]}, {"offset": [0.5, 0.3, 0.4], "until": "touch"}]
    plan = AnchoredActions().parse(steps, gripper=False)
    guarded = evaluate_batch(TASK, simulator, [replace(hook.candidate, plan=plan)])
    play(
        run_in(tmp_path, simulator),
        [Generation(0, tuple(guarded)), Generation(1, (hook,))],
    )
    marked, cleared = Recording(tmp_path / "recording.rrd").rows["/world/guards"]
    np.testing.assert_allclose(marked["positions"], [[0.5, 0.3, 0.4]], atol=0.002)
    assert marked["labels"][0].startswith("waypoint 2: never fired; reached at 1.16 s")
    assert cleared["positions"] == []


@pytest.mark.thorough
def test_a_soft_body_is_shown_by_its_nodes_as_they_move(tmp_path):
    engine, task = (
        installed().create("sim", "mujoco"),
        installed().create("task", "SpreadSlab"),
    )
    evaluations = evaluate_batch(task, engine, [solutions.anchored("SpreadSlab")])
    run = replace(run_in(tmp_path, engine), task=task)
    play(run, [Generation(0, tuple(evaluations))])
    recording = Recording(tmp_path / "recording.rrd")
    _, _, played = replay(run, evaluations[0].candidate, 25)
    skins = np.array(recording.column("/world/scene/slab", "vertex_positions"))
    np.testing.assert_allclose(skins, played.states.nodes("slab"), atol=1e-6)
    assert np.ptp(skins[-1, :, 2]) < 0.7 * np.ptp(skins[0, :, 2])
    (still,) = recording.static["/world/scene/slab"]
    assert np.array_equal(np.unique(still["triangle_indices"]), np.arange(32))


def test_wrong_settings():
    create = installed().create
    for settings in ({"hz": 0.0}, {"elites": "all"}):
        with pytest.raises(UsageError, match=next(iter(settings))):
            create("listener", "rerun", settings)
