"""A program as the model: what it gets, what is taken of it, and how it is ended."""

import json
import sys
import threading
import time

import pytest

from core.config.compose import load
from core.errors import UsageError, UserError
from core.search.orchestration import run
from plugins.vlms.command import Command
from tests.plugins.vlms.servers import PNG, request
from tests.support.model_runs import COMMON, SOLUTION

TELL = """
import json, os, sys
told = {"input": sys.stdin.read(), "words": sys.argv[1:], "files": sorted(os.listdir()), "names": sorted(os.environ)}
print(json.dumps(told))
"""


def ask(tmp_path, monkeypatch, code, *words, **settings):
    """Return the reply of a Python program to one request."""
    monkeypatch.chdir(tmp_path)
    model = Command([sys.executable, "-c", code, *words], **settings)
    (reply,) = model.complete([request(0)])
    return reply


def test_the_prompt_comes_on_standard_input_and_the_pictures_as_files(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("PLANTED_API_KEY", "sk-planted-0123456789")
    monkeypatch.setenv("WANTED_API_KEY", "sk-wanted-0123456789")
    reply = ask(tmp_path, monkeypatch, TELL, environment=["WANTED_API_KEY"])
    told = json.loads(reply.text)
    assert told["input"].startswith("Be brief.")
    assert "I am agent 0." in told["input"]
    assert told["files"] == ["prompt.md", "scene.png", "schema.json"]
    assert "WANTED_API_KEY" in told["names"]
    assert "PLANTED_API_KEY" not in told["names"]
    assert (reply.error, reply.unanswered) == (None, False)
    assert (tmp_path / "command/g0-a0/scene.png").read_bytes() == PNG


def test_paths_of_prompt_and_pictures_stand_where_the_words_want_them(
    tmp_path, monkeypatch
):
    reply = ask(tmp_path, monkeypatch, TELL, "--file={prompt}", "{pictures}", "$HOME")
    told = json.loads(reply.text)
    folder = tmp_path / "command" / "g0-a0"
    assert told["words"] == [
        f"--file={folder / 'prompt.md'}",
        str(folder / "scene.png"),
        "$HOME",
    ]
    assert told["input"] == ""


@pytest.mark.parametrize(
    ("code", "error"),
    [
        (
            "import sys; sys.exit('no subscription')",
            "the program ended with status 1: no subscription",
        ),
        ("print('limit reached'); exit(3)", "ended with status 3: limit reached"),
        ("pass", "the program printed nothing"),
        ("import os; os.kill(os.getpid(), 9)", "the program was ended by signal 9"),
    ],
)
def test_a_program_that_fails_is_a_failed_call_with_its_words(
    code, error, tmp_path, monkeypatch
):
    reply = ask(tmp_path, monkeypatch, code)
    assert error in reply.error
    assert reply.unanswered


def test_a_program_is_ended_with_all_that_it_started(tmp_path, monkeypatch):
    code = (
        "import subprocess, sys; "
        "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']).wait()"
    )
    began = time.monotonic()
    reply = ask(tmp_path, monkeypatch, code, timeout_s=1.0)
    assert "took longer than vlm.timeout_s=1" in reply.error
    assert time.monotonic() - began < 30


def test_output_is_bounded(tmp_path, monkeypatch):
    code = "import sys\nwhile True: sys.stdout.write('x' * 1_000_000)"
    reply = ask(tmp_path, monkeypatch, code)
    assert reply.error.startswith("the program printed more than 20 MB")
    assert reply.text == ""


def test_programs_run_side_by_side(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = "import time; time.sleep(1); print('{}')"
    model = Command([sys.executable, "-c", code], concurrency=3)
    before = threading.active_count()
    replies = list(model.complete([request(agent) for agent in range(3)]))
    assert {reply.text for reply in replies} == {"{}\n"}
    assert threading.active_count() <= before + 3


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "vlm.command is empty"),
        ({"command": ["no-such-program-here"]}, "there is no program"),
        ({"command": ["true"], "timeout_s": 0.0}, "vlm.timeout_s"),
        ({"command": ["true"], "environment": ["UNSET_HERE"]}, "UNSET_HERE is not set"),
    ],
)
def test_settings_that_cannot_be_used(settings, message):
    with pytest.raises(UserError, match=message):
        Command(**settings)


def test_a_key_in_the_command_is_refused(monkeypatch):
    monkeypatch.setenv("PLANTED_API_KEY", "sk-planted-0123456789")
    with pytest.raises(UsageError, match="holds a key"):
        Command(["true", "sk-planted-0123456789"])


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_a_whole_run_with_a_program(tmp_path):
    answer = tmp_path / "answer.json"
    answer.write_text(json.dumps({"strategies": [SOLUTION]}))
    small = ["budget=tiny"]
    words = ["vlm=command", f"vlm.command=[cat,{answer}]", "budget.n_iteration=0"]
    result = run(load("config", [*COMMON, *small, *words]), tmp_path / "run")
    assert result.best.reward > 0.95
    prompt = (tmp_path / "run/command/g0-a0/prompt.md").read_text()
    assert "JSON schema" in prompt
