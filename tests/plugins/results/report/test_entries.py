"""Entries of a benchmark: what is one, what is refused and why, and how they are compared."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from core.config.compose import load
from core.errors import UserError
from core.plugins import Offer, installed
from plugins.results.pages.runs import find_runs
from plugins.results.report import verify
from plugins.results.report.entries import ListedEntry, RunResult, read_entry
from plugins.results.report.entry_tables import entry_tables
from plugins.results.report.own_entries import find_entries
from plugins.results.report.protocols import fixed_settings, protocol
from plugins.results.report.report_command import main
from tests.core.run_folders import write_run
from tests.support.rare import rare

ROOT = Path(__file__).parents[4]
TASKS = protocol("varied").tracks["varied"]
pytestmark = pytest.mark.slow  # a whole track takes two dozen runs
UNSEEN = {"mujoco": (0.8,) * 20, "sapien": (0.5, 0.7) * 10}


def write(folder, *words, task="BringCube", unseen=UNSEEN, **others):
    return write_run(
        folder,
        "protocol=varied",
        "sim=mujoco",
        f"task={task}",
        *words,
        rewards=[[0.9, None]],
        unseen=unseen,
        **others,
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run of each task with each of two seeds."""
    root = tmp_path_factory.mktemp("whole")
    for task in TASKS:
        for seed in (0, 1):
            write(root / f"{task}_{seed}", f"seed={seed}", task=task, cost_usd=0.5)
    return root


@pytest.fixture(scope="module")
def entry(whole):
    ((made,), problems) = entries(whole, "ours")
    assert problems == []
    return made


@pytest.fixture
def runs(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "runs")
    return tmp_path / "runs"


def entries(folder, name=""):
    return find_entries(*find_runs([folder]), name)


def test_the_tracks_have_twelve_tasks_and_the_protocol_fixes_what_it_sets():
    assert len(TASKS) == 12
    fixed = fixed_settings("varied", "pybullet")
    assert fixed["rollout.perception.yaw"] == "0.01"
    assert fixed["fitness.unseen_sims"] == '["mujoco", "sapien"]'
    assert "fitness.layouts" not in fixed
    for name in ("none", "paper", "x=1", "../varied"):
        with pytest.raises(UserError, match=r"no (protocol|entries)"):
            protocol(name)


def test_a_lean_track_scores_what_holds_by_the_effort_that_it_saves():
    rules = protocol("lean")
    assert {task for track in rules.tracks.values() for task in track} == set(
        rules.references
    )
    reference = rules.references["InsertPlug"]
    run = RunResult(
        0,
        {"mujoco": (1.0,) * 20, "sapien": (0.92, 1.0) * 10},
        1,
        1,
        1,
        None,
        0.0,
        effort=reference,
    )
    assert run.score(rules, "InsertPlug") == 1
    tenth = replace(
        reference, motion_s=reference.motion_s / 10, mass_kg=reference.mass_kg / 10
    )
    assert replace(run, effort=tenth).score(rules, "InsertPlug") == pytest.approx(
        100 ** (1 / 3)
    )
    assert replace(run, effort=None).score(rules, "InsertPlug") == 0
    assert (
        replace(run, rewards=run.rewards | {"sapien": (0.9,) * 20}).score(
            rules, "InsertPlug"
        )
        == 0
    )
    assert run.score(protocol("varied"), "InsertPlug") == pytest.approx(0.96)


@pytest.mark.thorough
def test_an_entry_has_means_and_what_was_spent(entry):
    assert (entry.name, entry.protocol, entry.version, entry.track) == (
        "ours",
        "varied",
        2,
        "varied",
    )
    assert entry.score == pytest.approx(0.6)  # of the worse engine
    assert entry.tasks["OneBook"].reward("sapien") == pytest.approx(0.6)
    assert [run.seed for run in entry.tasks["OneBook"].runs] == [0, 1]
    first = entry.runs[0]
    assert (first.candidates, first.rollouts, first.requests, first.cost_usd) == (
        1,
        1,
        1,
        0.5,
    )
    assert entry.settings["vlm.name"] == "offline"
    assert "mujoco" in entry.versions
    table, by_task = entry_tables([ListedEntry(entry, "no")])
    row = dict(
        zip([column.name for column in table.columns], table.rows[0], strict=True)
    )
    assert (row["score"], row["low"], row["seeds"], row["cost (USD)"]) == pytest.approx(
        (0.6, 0.6, "0, 1", 12.0)
    )
    assert len(by_task.rows) == 12


@pytest.mark.thorough
def test_a_run_in_which_nothing_could_be_tried_counts_0(runs):
    shutil.rmtree(runs / "OneBook_0")
    words = ("protocol=varied", "task=OneBook", "sim=mujoco")
    write_run(runs / "OneBook_0", *words, rewards=[[None]])
    ((entry,), _) = entries(runs)
    assert sorted(entry.scores["OneBook"]) == pytest.approx([0.0, 0.6])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda runs: shutil.rmtree(runs / "OneBook_0"),
            "its tasks have other seeds, or one twice",
        ),
        (
            lambda runs: write(runs / "again"),
            "its tasks have other seeds, or one twice",
        ),
        (
            lambda runs: write(runs / "more", "seed=2", finish=False),
            "more is unfinished; resume it, or delete it",
        ),
        (
            lambda runs: write(runs / "more", unseen={"mujoco": UNSEEN["mujoco"]}),
            "its tasks have other seeds",
        ),
        (
            lambda runs: [shutil.rmtree(runs / f"OneBook_{seed}") for seed in (0, 1)],
            "it lacks OneBook; an entry has",
        ),
    ],
)
def test_what_is_no_entry_is_told_in_a_line(runs, change, said):
    change(runs)
    found, (problem,) = entries(runs, "ours")
    assert found == []
    assert problem.startswith("no entry of the track varied: ours: ")
    assert said in problem


@pytest.mark.parametrize(
    "word", ["material.most_g=900.0", "task.variation=near", "fitness.unseen=3"]
)
def test_runs_that_change_what_is_fixed_are_no_entry(tmp_path, word):
    key, _, value = word.partition("=")
    write(tmp_path / "run", word)
    _, (problem,) = entries(tmp_path)
    assert f": {key} is {value}" in problem
    assert "where the protocol varied has" in problem


REWARDS = ("tasks", "OneBook", "runs", 0, "rewards", "sapien")


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("version",), 1, "follows version 1 of the protocol varied, not 2"),
        (("track",), "easy", "no track 'easy'"),
        (("protocol",), "theirs", "theirs"),
        (
            ("settings", "material.infill"),
            "0.1",
            "material.infill is 0.1, where the protocol varied has 0.2",
        ),
        (
            REWARDS,
            [1.0] * 19,
            "a run lacks rewards in 20 unseen layouts in each of mujoco, sapien",
        ),
        (REWARDS, [7.0] * 20, "less than or equal to 1"),
        (("tasks", "Another"), {"runs": []}, "at least 1 item"),
        (("tasks",), [], "tasks: "),
        (
            ("settings", "sim.time_step"),
            "0.02",
            "sim.time_step is 0.02, where mujoco has 0.00",
        ),
        (("settings", "sim.name"), "../x", "sim.name is '../x', which is no engine"),
    ],
)
def test_a_results_file_that_breaks_the_protocol_is_refused(
    entry, tmp_path, path, value, said
):
    data = node = json.loads(entry.dump())
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    (tmp_path / "theirs.json").write_text(json.dumps(data))
    with pytest.raises(UserError, match=r"theirs.json can't be compared: ") as error:
        read_entry(tmp_path / "theirs.json")
    assert said in str(error.value)


def test_an_engine_whose_settings_are_not_known_here_is_refused(
    entry, tmp_path, monkeypatch
):
    far = Offer("sim", "far", "lab", "my-lab", "no_such_lab:Engine")
    monkeypatch.setitem(installed().offers, ("sim", "far"), far)
    settings = entry.settings | {"sim.name": "far", "sim.time_step": "0.02"}
    file = tmp_path / "theirs.json"
    file.write_bytes(replace(entry, settings=settings).dump())
    with pytest.raises(
        UserError,
        match=r"theirs.json can't be compared: the settings of its engine can't be checked here: .* can't be imported",
    ):
        read_entry(file)


def test_pipes_and_large_files_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(UserError, match="is no regular file"):
        read_entry(tmp_path / "pipe.json")
    with (tmp_path / "large.json").open("wb") as file:
        file.truncate(80_000_000)
    with pytest.raises(UserError, match="at most 10 MB are read"):
        read_entry(tmp_path / "large.json")


RECORDS = sorted((ROOT / "docs/entries").glob("*.json"))


@pytest.mark.parametrize("file", RECORDS, ids=lambda file: file.stem)
def test_records_follow_their_protocol_and_hold_their_designs(file):
    entry = read_entry(file)
    assert all(run.design for run in entry.runs)
    # By definition, but for rounded references.
    if entry.protocol == "lean" and entry.name == "reference":
        assert entry.scores == {
            task: pytest.approx([1], abs=1e-3) for task in entry.tasks
        }


def test_a_record_earns_its_score_again(monkeypatch, inline):
    quick = ["fitness.unseen=1", "fitness.unseen_sims=[mujoco]"]
    monkeypatch.setattr(
        verify, "load", lambda name, words: load(name, [*words, *quick])
    )
    entry = read_entry(ROOT / "docs/entries/lean_hard_reference.json")
    (run,) = entry.tasks["StopCart"].runs
    again = verify.try_again(entry, "StopCart", run)
    assert again.score(entry.rules, "StopCart") == pytest.approx(
        run.score(protocol("lean"), "StopCart"), rel=0.1
    )


@pytest.mark.thorough
@pytest.mark.parametrize("count", rare([1, 3], 1, mark="weekly"))
@pytest.mark.parametrize("file", RECORDS, ids=lambda file: file.stem)
def test_each_record_earns_its_rewards_again_in_some_layouts(
    file, count, monkeypatch, inline
):
    """``vlmgineer report verify=FILE`` tries all twenty."""
    few = [f"fitness.unseen={count}"]
    monkeypatch.setattr(verify, "load", lambda name, words: load(name, [*words, *few]))
    entry = read_entry(file)
    for task, result in entry.tasks.items():
        for run in result.runs:
            if run.score(entry.rules, task) == 0:
                continue

            again = verify.try_again(entry, task, run).rewards
            for engine, rewards in run.rewards.items():
                claimed = pytest.approx(
                    sum(rewards[:count]) / count, abs=verify.TOLERANCE
                )
                assert sum(again[engine]) / count == claimed, (task, run.seed, engine)


@pytest.mark.parametrize("key", ["tool.file", "tool.library"])
def test_a_results_file_names_no_file_of_this_machine(key):
    entry = read_entry(ROOT / "docs/entries/lean_hard_reference.json")
    (run,) = entry.tasks["StopCart"].runs
    strange = entry.settings | {"tool.name": "known", key: "/etc/hostname"}
    own = {k: v for k, v in strange.items() if not k.startswith("tool.") or k == key}
    settings = own | {"tool.name": "known"}
    with pytest.raises(UserError, match=rf"{key} names a (file|folder)"):
        verify.try_again(replace(entry, settings=settings), "StopCart", run)


def test_runs_write_their_design_and_the_command_verifies_it(
    entry, tmp_path, monkeypatch, capsys
):
    assert entry.runs[0].design["action_sets"]
    (tmp_path / "theirs.json").write_bytes(entry.dump())

    def try_again(entry, task, run):
        reward = 0.6 - 0.3 * run.seed
        rewards = {sim: [reward] * len(before) for sim, before in run.rewards.items()}
        return replace(run, rewards=rewards)

    monkeypatch.setattr("plugins.results.report.verify.try_again", try_again)
    with pytest.raises(
        UserError,
        match=r"claims what its designs don't earn here: .*OneBook with seed 1",
    ):
        main([f"verify={tmp_path / 'theirs.json'}", f"output={tmp_path / 'out'}"])
    assert "12 of 24 runs" in capsys.readouterr().out
    table = (tmp_path / "out/data/verification.csv").read_text()
    assert table.count(",yes\n") == table.count(",no\n") == 12


def test_the_command_writes_and_compares_results_files(
    whole, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)

    def run(*words):
        main(list(words))
        return capsys.readouterr().out

    run(f"runs={whole}", "name=first", "output=one")
    (file,) = (tmp_path / "one" / "data").glob("*.json")
    assert file.name == "varied_varied_first.json"
    shown = run(f"entries=[{file},{file}]", "output=two")
    assert shown.count("first") == 2
    table = (tmp_path / "two" / "data" / "entries.csv").read_text()
    assert table.count("\nvaried,first,source,0.6,") == 2
    assert "Entries of the benchmark" in (tmp_path / "two" / "index.html").read_text()
