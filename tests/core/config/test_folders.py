import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from core.config.compose import load
from core.config.folders import new_folder, task_folder

WORDS = [
    "task=BringCube",
    "budget=tiny",
]
WORDS += ["film=false", "listener=[]", "executor.workers=1", "seed=5"]


def test_each_gets_a_folder_of_its_own(tmp_path):
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(new_folder, [str(tmp_path / "runs" / "now")] * 40))
    assert len(set(made)) == 40
    assert str(tmp_path / "runs" / "now_40") in made
    assert all(Path(folder).is_dir() for folder in made)


def test_where_none_can_be_made_the_name_is_kept(tmp_path):
    (tmp_path / "file").write_text("")
    assert new_folder(str(tmp_path / "file" / "now")) == str(tmp_path / "file" / "now")
    assert new_folder(str(tmp_path / "file")) == str(tmp_path / "file_2")


@pytest.mark.thorough
@pytest.mark.parametrize("sweep", [False, pytest.param(True, marks=pytest.mark.weekly)])
def test_runs_begun_in_one_second_have_a_folder_each(sweep, tmp_path):
    """The clock stands still for all of them."""
    program = (
        "import datetime, runpy, sys\n"
        "class Still(datetime.datetime):\n"
        "    @classmethod\n"
        "    def now(cls, tz=None): return datetime.datetime(2026, 1, 31, 12, 0, 0, tzinfo=tz)\n"
        "import hydra.core.utils, core.config.folders\n"
        "hydra.core.utils.datetime = core.config.folders.datetime = Still\n"
        "from core.run import main\n"
        "if __name__ == '__main__': main(sys.argv[1:])\n"
    )
    (tmp_path / "still.py").write_text(program)
    words = ["-m", *WORDS[:-1], "seed=5,6"] if sweep else WORDS
    command = [sys.executable, "still.py", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    runs = [subprocess.Popen(command, cwd=tmp_path, **pipes) for _ in range(2)]
    said = [run.communicate(timeout=300) for run in runs]
    assert [run.returncode for run in runs] == [0, 0], said
    found = sorted(path.parent for path in tmp_path.rglob("result.json"))
    assert len(found) == (4 if sweep else 2)
    parents = {folder.parent.name if sweep else folder.name for folder in found}
    assert parents == {"2026-01-31_12-00-00", "2026-01-31_12-00-00_2"}


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["task=OneBook"], "OneBook"),
        (["task=file", "task.file=../bench/turn_gate.yaml"], "turn_gate"),
        (["task=file", "task.file=.."], "file"),
    ],
)
def test_a_run_lies_in_a_folder_named_by_its_task_or_the_task_s_file(words, name):
    assert task_folder(load("config", words).task) == name
