"""``vlmgineer study``: what a file says, what it will take, and that each run is run once."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from omegaconf import OmegaConf

from core.config.compose import load
from core.errors import UserError
from core.search.orchestration import run
from plugins.results.report.report_command import report
from plugins.results.study.estimate import look_ahead
from plugins.results.study.study_command import main
from plugins.results.study.study_files import (
    RECORD,
    Selection,
    StudyRun,
    find_record,
    find_study,
    read_study,
)
from tests.core.run_folders import write_run
from tests.plugins.vlms.servers import Say, serving
from tests.support.processes import family, wait_until
from tests.support.text import read_csv

SOLUTIONS = Path(__file__).parents[3] / "tasks" / "solutions"
SMALL = {
    "about": "Two methods.",
    "tasks": ["BringCube", "OneBook"],
    "seeds": 1,
    "settings": ["film=false", "sim=mujoco", "listener=[]", "prompt.picture=false"],
    "budgets": {"tiny": ["budget=tiny", "budget.n_action=2"]},
    "methods": [
        {"name": "first", "settings": ["budget.n_iteration=1"]},
        {"name": "hand", "settings": ["tool=none", "budget.n_iteration=0"]},
        {"name": "told", "language": True, "settings": ["prompt=human"]},
    ],
}


def write(folder, **changes):
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump(SMALL | changes))
    return str(file)


STUDIES = ["paper", "layouts", "engines", "search", "winners"]


@pytest.mark.weekly
@pytest.mark.parametrize("name", STUDIES)
def test_the_studies_of_the_project_are_estimated(tmp_path, monkeypatch, capsys, name):
    """Each word of each method is one that a run takes; without a terminal nobody is asked, and nothing starts."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match="nothing was started; to start, add yes=true"):
        main([name, "ask_h=0", "seeds=1"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].split()[0] == "all"
    study = read_study(find_study(name))
    assert {line.split()[0] for line in lines} >= {
        method.name for method in study.methods if not method.language
    }
    assert not list(tmp_path.iterdir())


def test_the_file_on_the_page_is_a_study(tmp_path):
    page = (SOLUTIONS.parents[2] / "docs/paper.md").read_text()
    (block,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "mine.yaml").write_text(block)
    study = read_study(tmp_path / "mine.yaml")
    assert [method.name for method in study.methods] == ["once", "twice"]


@pytest.mark.weekly
@pytest.mark.slow
def test_the_paper_with_a_language_model_says_what_it_costs(
    tmp_path, monkeypatch, capsys
):
    """There is a text by each kind of author for each task."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match="nothing was started"):
        main(["paper", "vlm=gemini", "budget=paper"])
    rows = {
        line.split()[0]: line.split() for line in capsys.readouterr().out.splitlines()
    }
    assert rows["full"][1:5] == ["60", "60", "5,050", "610,000"]
    assert rows["layperson"][1:5] == ["60", "60", "60", "3,000"]
    assert 1000 < float(rows["all"][-1].replace(",", "")) < 10_000


MISSING = {"methods": [{"name": "restless", "settings": ["evolution=Restless"]}]}


@pytest.mark.parametrize(
    ("words", "changes", "said"),
    [
        ("nothing", {}, "no study 'nothing'"),
        ("small.yaml tasks=OneBok", {}, "did you mean 'OneBook'?"),
        ("small.yaml methods=frist", {}, "did you mean 'first'?"),
        ("small.yaml budget=huge", {}, "possible: tiny"),
        ("small.yaml methods=told", {}, "name a language model"),
        ("small.yaml jobs=0", {}, "jobs: must be greater"),
        ("small.yaml sim=mojoco", {}, "did you mean 'mujoco'?"),
        ("small.yaml", MISSING, "no evolution 'Restless' in method 'restless'"),
        ("small.yaml", MISSING, "once its package is installed: pip install -e FOLDER"),
        ("small.yaml", {"seeds": 0}, "small.yaml: seeds: must be greater"),
        ("small.yaml", {"methods": [{"name": "a b"}]}, "methods.0.name: "),
        ("small.yaml", {"methods": [{"name": ".."}]}, "methods.0.name: "),
        ("small.yaml", {"methods": [{"name": "report"}]}, "can't name a folder"),
        ("small.yaml", {"methods": 2 * [{"name": "a"}]}, "two methods have the name"),
        ("small.yaml", {"tasks": ["a.yaml", "b/a.yaml"]}, "two tasks have the name"),
        ("small.yaml", {"tasks": [".."]}, "tasks: '..' can't name a folder"),
        ("small.yaml", {"author": "me"}, "small.yaml: author: no key 'author'"),
        ("", {}, "no study is named; usage: "),
    ],
)
def test_mistakes(tmp_path, monkeypatch, words, changes, said):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, **changes)
    with pytest.raises(UserError, match=re.escape(said)):
        main(words.split())


@pytest.mark.thorough
@pytest.mark.slow
def test_what_is_there_is_not_run_again(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = write(tmp_path)
    main([file, "tasks=BringCube", "folder=done", "jobs=2", "launch=nice -n 1"])
    said = capsys.readouterr()
    assert "left out: told; vlm=offline reads no words" in said.out
    assert "2/2 runs" in said.err
    rewards = read_csv(tmp_path / "done/report/data/rewards.csv")
    assert [row["method"] for row in rewards] == ["first", "hand"]
    stored = {
        file: file.read_bytes() for file in tmp_path.glob("done/*/*/*/result.json")
    }
    assert len(stored) == 2

    shutil.rmtree(tmp_path / "done/report")
    main([file, "tasks=BringCube", "folder=done"])
    assert capsys.readouterr().err == ""
    assert all(path.read_bytes() == data for path, data in stored.items())
    with pytest.raises(
        UserError, match=r"hold.* runs of first/BringCube that differ in: sim"
    ):
        main([file, "tasks=BringCube", "folder=done", "sim=sapien"])


FAIL = """
import sys
import time

time.sleep(2 if any("ScoreGoal" in word for word in sys.argv) else 0)
sys.exit("it can't start")
"""


def fail(folder, capsys, tasks, jobs):
    """Return how many runs a study says have failed; each has a line."""
    (folder / "fail.py").write_text(FAIL)
    launch = f"launch={sys.executable} {folder / 'fail.py'}"
    words = ["methods=first", f"folder={folder / 'failed'}", f"jobs={jobs}", launch]
    with pytest.raises(UserError, match=r"runs failed; .* it can't start") as raised:
        main([write(folder, tasks=tasks), *words])

    failed = int(str(raised.value).split()[0])
    assert capsys.readouterr().err.count("it can't start") == failed
    return failed


TASKS = ["BringCube", "OneBook", "MoveBall", "ScoreGoal", "LiftBox", "HighObject"]


def test_a_run_under_way_when_three_have_failed_is_counted_too(tmp_path, capsys):
    assert fail(tmp_path, capsys, TASKS[:4], jobs=4) == 4


@pytest.mark.thorough
def test_after_three_failures_no_run_begins(tmp_path, capsys):
    """The next run may begin while the third failure is noted. A report of no run would hide why all failed."""
    assert 3 <= fail(tmp_path, capsys, TASKS, jobs=1) < 6


SCENE_TASKS = {"tasks": ["BringCube", "own.yaml"]}


@pytest.mark.parametrize(
    ("changes", "words", "scene", "said"),
    [
        (
            {},
            ["vlm.model=b"],
            "one",
            "first/own that differ in: vlm.model=a vlm.model=b",
        ),
        (
            {},
            ["vlm.model=a", "vlm.run=b"],
            "one",
            "first/own that differ in: vlm.run=b",
        ),
        ({}, ["vlm.model=a"], "two", "own that differ in: the scene file's checksum"),
        ({"by_task": {"own": ["seed=3"]}}, ["vlm.model=a"], "one", "own that differ"),
        ({}, ["vlm.model=a", "vlm.timeout_s=1", "film=true"], "one", ""),
    ],
)
def test_another_model_or_scene_is_another_run(tmp_path, changes, words, scene, said):
    (tmp_path / "own.yaml").write_text("one")
    file = Path(write(tmp_path, **SCENE_TASKS))
    folder = tmp_path / "done"
    before = Selection(read_study(file), file, folder, "tiny", ("vlm.model=a",))
    (folder / "first/own").mkdir(parents=True)
    methods = before.study.methods
    (folder / RECORD).write_text(before.record(methods, before.study.tasks))

    (tmp_path / "own.yaml").write_text(scene)
    study = read_study(Path(write(tmp_path, **SCENE_TASKS, **changes)))
    now = Selection(study, file, folder, "tiny", tuple(words))
    if said:
        with pytest.raises(UserError, match=re.escape(said)):
            now.check_record(methods, study.tasks)
    else:
        now.check_record(methods, study.tasks)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "budget: tiny\nwords:\n  fir",
        "[1, 2]",
        "words: 3",
        "study: {about: 2024-13-45}",
        "[" * 10_000,
        "\0",
        "budget: tiny\nwords: {first: 3}\nstudy: null\n",
    ],
)
def test_a_record_that_cannot_be_read_stops_nothing(tmp_path, capsys, text):
    file = Path(write(tmp_path))
    folder = tmp_path / "done"
    (folder / "first").mkdir(parents=True)
    (folder / RECORD).write_text(text)
    selection = Selection(read_study(file), file, folder, "tiny")
    selection.check_record(selection.study.methods, selection.study.tasks)
    assert f"warning: {folder / RECORD}" in capsys.readouterr().err
    assert find_record([folder]) is None

    again = selection.record(selection.study.methods, selection.study.tasks)
    (folder / RECORD).write_text(again)
    assert find_record([folder]) == selection.study


def test_what_is_left_of_a_run_is_estimated(tmp_path):
    words = ("task=BringCube", "budget.n_agent=1")
    begun = write_run(tmp_path / "begun", *words, rewards=[[0.3, 0.6]], finish=False)
    runs = [StudyRun("a", "", 0, folder, words) for folder in (tmp_path / "new", begun)]
    new, rest = look_ahead(runs, 1).needs.values()
    assert new.requests - rest.requests == 1
    assert new.rollouts - rest.rollouts == 2


def test_it_is_said_which_rollouts_decide_between_the_best(tmp_path, capsys):
    words = ("task=BringCube", "budget.n_agent=1")
    run = StudyRun("a", "", 0, tmp_path / "new", words)
    outlook = look_ahead([run], 1)
    (need,) = outlook.needs.values()
    assert 0 < need.deciding < need.rollouts
    outlook.show()
    said = capsys.readouterr().out
    assert f"up to {need.deciding} of these rollouts decide" in said
    assert "budget.final_s" in said

    none = ("budget.final_s=0", "budget.elite_s=0")
    outlook = look_ahead([StudyRun("a", "", 0, tmp_path / "new", words + none)], 1)
    outlook.show()
    assert "decide" not in capsys.readouterr().out


def test_published_figures_stand_beside_those_of_the_runs(tmp_path):
    """On the tasks that all methods of a figure have; nothing where a method is not there."""
    write_run(tmp_path / "a", "name=full", "task=ElevatePlate", rewards=[[0.5]])
    write_run(tmp_path / "b", "name=full", rewards=[[0.75]])
    write_run(tmp_path / "c", "name=rlbench", rewards=[[0.5]])
    file = find_study("paper")
    selection = Selection(read_study(file), file, tmp_path, "quick")
    (tmp_path / RECORD).write_text(
        selection.record(selection.study.methods, ["ElevatePlate"])
    )

    # One that never began has nothing but Hydra's notes.
    never = tmp_path / "d" / ".hydra" / "config.yaml"
    never.parent.mkdir(parents=True)
    OmegaConf.save(load("config", ["name=full", "task=ElevatePlate"]), never)

    report([tmp_path], tmp_path)
    rows = read_csv(tmp_path / "data/published.csv")
    assert [f"{row['published']} {row['here']}" for row in rows] == [
        "0.938 0.5",
        "0.428 ",
        "24.3 50.0",
        "64.7 ",
    ]


def play_stored(call):
    """Answer with the reference solution of the task, in the form that is asked for."""
    wanted = json.dumps(call.body["generationConfig"]["response_json_schema"])
    task = "ScoreGoal" if "class ScoreGoal" in "".join(call.texts) else "BringCube"
    solution = json.loads((SOLUTIONS / f"{task}.json").read_text())["strategies"][0]
    if "tool_urdf" not in wanted:
        tool = [key for key in solution if key.startswith("tool_")]
        solution = {key: solution[key] for key in solution if key not in tool}
    if '"maxItems": 7' in wanted:
        plan = [[*waypoint, 0.0] for waypoint in solution["action_sets"][0]]
        solution |= {"gripper": True, "action_sets": [plan]}
    return Say(json.dumps({"scene_analysis": "", "strategies": [solution]}))


def results_in(folder):
    """What the runs in a folder came to, without their times."""
    found = {}
    for file in sorted(folder.glob("*/*/*/result.json")):
        result = json.loads(file.read_text())
        for key in ("wall_time_s", "rollouts_per_s"):
            del result[key]
        found[str(file.parent.relative_to(folder))] = result
    return found


@pytest.mark.weekly
@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_a_study_that_is_killed_three_times(tmp_path, monkeypatch):
    """Of two tasks and all methods of the paper, with a model on a server. No request is sent twice, and the results
    are those of the runs alone. Killed are the study, whose run goes on alone, or the study with its run.
    """
    monkeypatch.setenv("GEMINI_API_KEY", "AIza-planted+0123456789")
    monkeypatch.setenv("PYTHONPATH", str(SOLUTIONS.parents[2]))
    words = "vlm=gemini prompt.repair=0 sim=mujoco prompt.picture=false listener=[]"
    words += " budget.n_agent=1 budget.n_tool=1 budget.n_action=1 budget.n_iteration=1"
    asked = "paper tasks=BringCube,ScoreGoal seeds=1 jobs=1 yes=true folder=killed"

    with serving(play_stored) as server:
        words += f" vlm.api_base={server.url}"

        def start():
            command = f"-m core study {asked} {words}".split()
            return subprocess.Popen(
                [sys.executable, *command], cwd=tmp_path, start_new_session=True
            )

        for kill in range(3):
            study = start()
            goal = len(server.calls) + 2
            wait_until(lambda goal=goal: len(server.calls) >= goal, study)
            time.sleep(0.3)  # the reply is on the disk, and its design is tried
            victims = family(study.pid) if kill % 2 else [study.pid]
            for process in victims:
                os.kill(process, signal.SIGKILL)
            study.wait()

        assert start().wait() == 0
        killed = results_in(tmp_path / "killed")
        calls = len(server.calls)

        file = find_study("paper")
        study = read_study(file)
        alone = Selection(
            study, file, tmp_path / "alone", "quick", tuple(words.split())
        )
        runs = alone.plan(study.methods, ["BringCube", "ScoreGoal"], 1)
        need = look_ahead(runs, 1).whole
        for planned in runs:
            planned.folder.mkdir(parents=True)
            run(load("config", planned.words), planned.folder)

    assert len(killed) == len(runs) == 14
    assert results_in(tmp_path / "alone") == killed
    assert need.requests == calls == len(server.calls) - calls
    used = sum(result["rollouts"] for result in killed.values())
    assert used <= need.rollouts
