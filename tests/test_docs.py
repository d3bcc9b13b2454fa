"""Every command in README and docs runs, with a budget cut down to seconds; every example of code is what it says."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import UsageError
from core.plugins import Plugins
from tests.core.run_folders import write_run

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SMALL = ["budget.n_agent=1", "budget.n_tool=1", "budget.n_action=2", "budget.n_iteration=0", "film=false"]


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.S)


def commands() -> list[str]:
    lines = [line for page in PAGES for block in blocks(page, "sh") for line in block.splitlines()]
    return sorted({line for line in lines if line.startswith("python -m ")})


def test_there_are_commands_and_nothing_else_than_the_two_set_ups():
    others = {
        line
        for page in PAGES
        for block in blocks(page, "sh")
        for line in block.splitlines()
        if not line.startswith("python -m ")
    }
    assert len(commands()) > 5
    assert all(line.startswith("python3.11 -m venv .venv && ") for line in others)
    assert len(others) == 2


@pytest.mark.parametrize("line", commands())
def test_command(line: str, tmp_path: Path):
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    words = shlex.split(line)[1:]
    if words[1] == "core.run" and "--help" not in words:
        words += SMALL
    if words[1] in ("core.report", "core.gallery"):
        write_run(tmp_path / words[2] / "0")  # what the page's line before it leaves
    done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def test_relative_links_lead_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(((?!https?:)[^)#]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_example_plugin_works(tmp_path, monkeypatch, capsys):
    (tmp_path / "my_plugin.py").write_text(blocks(ROOT / "docs/plugins.md", "python")[0])
    monkeypatch.syspath_prepend(tmp_path)
    import my_plugin

    plugins = Plugins({"my_plugin": my_plugin})
    listener = plugins.create("logger", "shout", {"mark": "?"})
    listener.generation_finished(type("Generation", (), {"index": 3}))
    assert capsys.readouterr().out == "generation 3 is done?\n"
    with pytest.raises(UsageError, match="mark"):
        plugins.create("logger", "shout", {"marc": "?"})


@pytest.mark.parametrize("number", [0, 1])
def test_python_as_the_page_has_it(number, tmp_path):
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    code = blocks(ROOT / "docs/python.md", "python")[number]
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert len(blocks(ROOT / "docs/python.md", "python")) == 2
    if number == 0:
        reward, folder = done.stdout.splitlines()[-1].split()
        assert json.loads((tmp_path / folder / "result.json").read_text())["best"]["reward"] == float(reward)


def test_example_configs_are_found_through_the_hook(tmp_path, monkeypatch):
    folder = tmp_path / "my_task"
    (folder / "conf/task").mkdir(parents=True)
    (folder / "__init__.py").write_text(blocks(ROOT / "docs/plugins.md", "python")[1])
    monkeypatch.syspath_prepend(tmp_path)
    import my_task

    plugins = Plugins({"my_task": my_task})
    assert plugins.configs["this process"] == ["pkg://my_task.conf"]
    assert not [failure for failure in plugins.failures if failure.entry_point == "my_task"]
    assert "PullBlock" in plugins.names("task")


def test_example_design_is_json():
    (text,) = blocks(ROOT / "docs/designs.md", "json")
    assert json.loads(text)["strategies"][0]["action_sets"]
