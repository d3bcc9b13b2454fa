"""``vlmgineer study``: what a file says, what it will take, and that each run is run once."""

import re
import shutil
from pathlib import Path

import pytest
import yaml

from core.errors import UserError
from plugins.results.study.command import main
from plugins.results.study.files import find_study, read_study
from tests.plugins.results.report.test_tables import read_csv

ROOT = Path(__file__).parents[4]
SMALL = {
    "about": "Two methods.",
    "tasks": ["BringCube", "OneBook"],
    "seeds": 1,
    "settings": ["film=false", "sim=mujoco", "listener=[]", "prompt.picture=false"],
    "budgets": {"tiny": ["budget.n_agent=1", "budget.n_tool=1", "budget.n_action=2"]},
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


@pytest.mark.parametrize("name", ["paper", "layouts", "engines", "search", "winners"])
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


@pytest.mark.parametrize(
    ("words", "changes", "said"),
    [
        (["nothing"], {}, "no study 'nothing'"),
        (["small.yaml", "tasks=OneBok"], {}, "did you mean 'OneBook'?"),
        (["small.yaml", "methods=frist"], {}, "did you mean 'first'?"),
        (["small.yaml", "budget=huge"], {}, "possible: tiny"),
        (["small.yaml", "methods=told"], {}, "name a language model"),
        (["small.yaml", "jobs=0"], {}, "jobs: Input should be greater"),
        (["small.yaml", "sim=mojoco"], {}, "did you mean 'mujoco'?"),
        (["small.yaml"], {"seeds": 0}, "small.yaml: seeds: Input should be greater"),
        (["small.yaml"], {"methods": [{"name": "a b"}]}, "methods.0.name: "),
        (["small.yaml"], {"author": "me"}, "small.yaml: author: Extra inputs"),
        ([], {}, "no study is named; usage: "),
    ],
)
def test_mistakes(tmp_path, monkeypatch, words, changes, said):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, **changes)
    with pytest.raises(UserError, match=re.escape(said)):
        main(words)


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
    with pytest.raises(UserError, match=r"hold.* runs of first that differ in: sim"):
        main([file, "tasks=BringCube", "folder=done", "sim=sapien"])
