"""Signals, closed output, and what lists import."""

import os
import re
import subprocess
import sys

import pytest

from core.config.compose import load
from core.errors import UsageError
from core.support import cli
from tests.support.rare import rare


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [["core.plugins"], ["core.run", "--help"], ["core", "evaluate", "--help"]],
    ids=" ".join,
)
@pytest.mark.parametrize(
    "buffering", rare([[], ["-u"]], []), ids=["buffered", "unbuffered"]
)
def test_output_that_is_closed_at_its_other_end(words, buffering):
    """As with ``| head``."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as output:
        done = subprocess.run(
            [sys.executable, *buffering, "-m", *words],
            stdout=output,
            stderr=subprocess.PIPE,
        )
    assert (done.returncode, done.stderr) == (1, b"")


def test_output_that_can_not_be_written():
    command = f"'{sys.executable}' -m core.plugins > /dev/full"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True)
    said = "error: the output can't be written: No space left on device"
    assert (done.returncode, done.stderr.strip()) == (1, said)


SLOW = {
    "scipy",
    "trimesh",
    "coal",
    "pinocchio",
    "matplotlib",
    "rerun",
    "mujoco",
    "pybullet",
    "sapien",
    "litellm",
}


@pytest.mark.parametrize(
    ("words", "said"),
    [(["core", "--help"], "conformance"), (["core.plugins"], "BringCube")],
)
def test_lists_import_nothing_that_only_runs_need(words, said):
    program = f"""
import atexit, runpy, sys
atexit.register(lambda: sys.stderr.write(" ".join({SLOW | {"ray"}} & sys.modules.keys())))
sys.argv = {words}
runpy.run_module({words[0]!r}, run_name="__main__", alter_sys=True)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True
    )
    assert said in done.stdout
    assert (done.returncode, done.stderr) == (0, "")


HOSTILE = "a\x1b]0;owned\x07\x1b[2J\x9b31m\u202eb\nbest reward 1.000\r\udcff\u2028c"
SHOWN = r"a\x1b]0;owned\x07\x1b[2J\x9b31m\u202eb\nbest reward 1.000\r\udcff\u2028c"


def test_a_line_shows_what_is_not_printable(capsys):
    cli.say(HOSTILE, "é")
    cli.say(HOSTILE, file=sys.stderr)
    assert capsys.readouterr() == (f"{SHOWN}\né\n", f"{SHOWN}\n")


@pytest.mark.parametrize(
    ("fault", "code", "shown"),
    [
        (
            "from core.errors import UserError; raise UserError('a\\x1b[2J\\u202eb')",
            1,
            r"error: a\x1b[2J\u202eb",
        ),
        (
            "from core.support.cli import say; say('\u2717 a\u202eb')",
            0,
            r"\u2717 a\u202eb",
        ),
        (
            "from core.support.cli import print_table; print_table(['\u2717'], [])",
            0,
            r"\u2717",
        ),
        ("print('\u2717')", 0, r"\u2717"),
    ],
)
@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_command_prints_anything_in_any_encoding(fault, code, shown, encoding):
    program = f"from core.support.cli import command\ndef main(words):\n    {fault}\ncommand(main)"
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": encoding},
    )
    assert done.returncode == code
    assert (done.stdout + done.stderr).decode(encoding).splitlines()[-1] == shown


@pytest.mark.parametrize(
    ("given", "joined"),
    [
        (
            ["task=file", "robot.home=[0,", "0.35]"],
            ["task=file", "robot.home=[0, 0.35]"],
        ),
        (["a=[0,", "-0.3,", "1]", "b=2"], ["a=[0, -0.3, 1]", "b=2"]),
        (["a={b:", "c}"], ["a={b: c}"]),
        (
            ["a={b: [1,", "2],", "c: {d: 3},", "e: 4}"],
            ["a={b: [1, 2], c: {d: 3}, e: 4}"],
        ),
        (["a=[0]", "folder"], ["a=[0]", "folder"]),
        (["new", "scene", "Name"], ["new", "scene", "Name"]),
        ([], []),
    ],
)
def test_a_value_that_a_shell_took_apart_is_joined(given, joined):
    assert cli.join_words(given) == joined


@pytest.mark.parametrize(
    ("value", "path"),
    [
        ("runs/a (1)", "runs/a (1)"),
        ('"runs/a (1)"', "runs/a (1)"),
        ("'runs/a'", "runs/a"),
        (r'"a \"b\""', 'a "b"'),
        ('"there"', '"there"'),
        ('"', '"'),
    ],
)
def test_a_path_is_read_in_quotes_or_without(tmp_path, monkeypatch, value, path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / '"there"').touch()
    assert str(cli.read_path(value)) == path


def test_an_override_that_hydra_cannot_read():
    """Such as a folder's name that is not UTF-8; in quotes it is read."""
    with pytest.raises(
        UsageError,
        match="can't read designs=r\udcff; put its value in quotes: 'designs=",
    ):
        load("evaluate", ["task=BringCube", "designs=r\udcff"])
    assert (
        load("evaluate", ["task=BringCube", 'designs="r\udcff"']).designs == "r\udcff"
    )


ROWS = [
    ["OneBook", "tool=none and a long name of a method " * 3, "0.029 ± 0.012"],
    ["[b]x[/]\x1b[31m", "", "1"],
]


def test_a_table_in_a_pipe_has_a_line_per_row(capsys):
    cli.print_table(["task", "method", "reward"], ROWS, ["reward"])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["task", "OneBook", "[b]x[/][31m"]
    assert lines[1].endswith(f"{ROWS[0][1].strip()}  0.029 ± 0.012")
    assert len(lines[2]) == len(lines[1])  # numbers end where the others do


def test_a_table_on_a_terminal_folds_text_but_no_number(monkeypatch):
    ours, terminal = os.openpty()
    with os.fdopen(ours) as output, os.fdopen(terminal, "w") as file:
        monkeypatch.setenv("COLUMNS", "40")
        cli.print_table(["task", "method", "reward"], ROWS, ["reward"], file)
        file.flush()
        lines = [output.readline() for _ in range(8)]
    text = "".join(lines)
    assert "0.029 ± 0.012" in text
    assert max(len(re.sub(r"\x1b\[[\d;]*m", "", line).rstrip()) for line in lines) <= 40
