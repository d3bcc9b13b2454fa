"""``vlmgineer report`` as a user runs it."""

import os
import re
import subprocess
import sys
from urllib.parse import quote

import pytest

from core.errors import UserError
from plugins.results.report.command import main
from tests.core.run_folders import write_run
from tests.rare import rare

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("folder", ["0_seed=0", "runs=0_seed=0"])  # as it is, with a = as multiruns have, or by key
def test_the_command(tmp_path, monkeypatch, capsys, folder):
    write_run(tmp_path / "0_seed=0", rewards=[[0.25]])
    monkeypatch.chdir(tmp_path)
    main([folder, "output=out"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[-5:] == ["1", "0.250", "0.250", "–", "1.50"]
    assert lines[-1] == "out/index.html"
    assert {f.suffix for f in (tmp_path / "out" / "data").iterdir()} == {".csv", ".png", ".svg"}


def test_no_line_is_folded_or_cut_in_a_pipe(tmp_path, capsys):
    """The folder's name alone is wider than a terminal."""
    name = "killed_" * 20
    write_run(tmp_path / "runs" / "finished", rewards=[[0.25]])
    write_run(tmp_path / "runs" / name, "seed=1", rewards=[[0.5]], finish=False)
    main([str(tmp_path / "runs"), f"output={tmp_path / 'out'}"])
    (line,) = [line for line in capsys.readouterr().out.splitlines() if name in line]
    assert line.startswith("not counted, unfinished: ")
    assert line.endswith("1 candidates done, best reward so far 0.500; it goes on")


@pytest.mark.skipif(os.name == "nt", reason="names are text there")
@pytest.mark.parametrize("command", rare(["report", "gallery"], "report"))
def test_a_folder_of_any_name_and_a_terminal_of_few_letters(tmp_path, command):
    """The name is not UTF-8, and has letters that the terminal's encoding lacks."""
    name = os.fsdecode(b"r\xff\xe9") + "\u2717"
    write_run(tmp_path / name, rewards=[[0.25]])
    words = [sys.executable, "-m", "core", command, name, "output=out"]
    env = {**os.environ, "PYTHONIOENCODING": "latin-1"}
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, timeout=240, env=env)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.splitlines()[-1] == b"out/index.html"
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert quote(os.fsencode(name)) in page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no folder given; usage: "),
        (["--output", "x"], "can't read '--output'; usage: "),
        (["nowhere"], "no folder nowhere"),
        (["."], "holds no run"),
        (["killed", "output=out"], "no run is finished; 1 are listed in out/index.html"),
        (["killed", "output=killed/run.sqlite"], "can't write"),
        (["killed", "names=ours"], "no key 'names' in the configuration (did you mean 'name'?)"),
    ],
)
def test_mistakes(tmp_path, monkeypatch, words, said):
    if "killed" in words:
        write_run(tmp_path / "killed", finish=False)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=re.escape(said)):
        main(words)
