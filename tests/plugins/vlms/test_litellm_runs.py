"""Whole runs with a language model on a server: results, files, and no secrets in them."""

import json
import os
import signal
import sqlite3
import time
from contextlib import closing
from urllib.parse import quote

import pytest

from core.config.compose import load
from core.errors import UserError
from core.search.orchestration import resume, run
from tests.plugins.vlms.asking import KEYS
from tests.plugins.vlms.servers import Reset, Say, Send, document, serving
from tests.support.commands import warm_python
from tests.support.model_runs import COMMON, SOLUTION
from tests.support.rare import rare

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm", "inline")]


def result(folder):
    """A run's result without the fields that may differ between equal runs."""
    found = json.loads((folder / "result.json").read_text())
    return {
        key: value
        for key, value in found.items()
        if key not in ("wall_time_s", "rollouts_per_s", "vlm")
    }


def secrets_in(folder):
    """The files below ``folder`` with a planted key in them."""
    files = [file for file in folder.rglob("*") if file.is_file()]
    assert len(files) > 10
    keys = [
        part
        for key in KEYS.values()
        for part in (key.encode(), key.encode().replace(b"/", b"%2F"))
    ]
    return [file for file in files if any(key in file.read_bytes() for key in keys)]


@pytest.mark.thorough
def test_a_served_run_has_the_result_of_its_answers(tmp_path):
    small = [
        *COMMON,
        "budget=tiny",
        "budget.n_agent=2",
        "budget.n_iteration=1",
    ]
    run(load("config", ["vlm=offline", *small]), tmp_path / "offline")
    # The embedded designer's answers, served in the order in which one caller at a time asks for them.
    ids = ["g0-a0", "g0-a1", "g1-a0", "g1-a1"]
    answers = iter(
        [
            Say((tmp_path / "offline" / "replies" / f"{name}.txt").read_text())
            for name in ids
        ]
    )
    with serving(lambda call: next(answers)) as server:
        chosen = ["vlm=gemini", f"vlm.api_base={server.url}", "vlm.concurrency=1"]
        run(load("config", [*chosen, *small]), tmp_path / "served")
    expected = result(tmp_path / "offline")
    assert expected["best"]["reward"] > 0
    assert result(tmp_path / "served") == expected
    assert len(server.calls) == len(ids)
    assert server.calls[0].pictures == [
        (tmp_path / "served" / "scene.png").read_bytes()
    ]
    schema = json.loads(
        (tmp_path / "served" / "requests" / "g1-a1.schema.json").read_text()
    )
    assert server.calls[3].body["generationConfig"]["response_json_schema"] == schema
    with closing(sqlite3.connect(tmp_path / "served" / "run.sqlite")) as database:
        rows = database.execute(
            "SELECT request_id, prompt_tokens, cost_usd > 0 FROM replies ORDER BY 1"
        ).fetchall()
    assert rows == [(name, 1000, 1) for name in ids]
    assert not secrets_in(tmp_path)


@pytest.mark.thorough
def test_a_run_that_reaches_its_limit_ends_well_and_resumes_with_a_higher_one(
    tmp_path, monkeypatch
):
    folder = tmp_path / "run"
    words = [
        *COMMON,
        "budget=tiny",
        "budget.n_agent=4",
    ]
    with serving(lambda call: Say(json.dumps({"strategies": [SOLUTION]}))) as server:
        model = ["vlm=gemini", f"vlm.api_base={server.url}", "vlm.concurrency=1"]
        first = run(
            load("config", [*model, *words, "vlm.max_tokens_total=1500"]), folder
        )
        assert len(server.calls) == 2
        message = "vlm.max_tokens_total=1500 is reached: 2014 tokens are used; 2 of 4 requests are left without a reply"
        assert message in first.stopped
        assert first.best.reward > 0.95
        assert (folder / "best" / "design.json").is_file()
        with monkeypatch.context() as elsewhere:  # where nobody has typed the address
            elsewhere.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
            with pytest.raises(
                UserError, match=rf"type it again: 'vlm\.api_base=.*{server.url}"
            ):
                resume(folder, ["vlm.max_tokens_total=null"])
        assert len(server.calls) == 2
        resume(folder, ["vlm.max_tokens_total=null"])
    assert (
        len({call.body["generationConfig"]["seed"] for call in server.calls})
        == len(server.calls)
        == 4
    )
    (generation,) = result(tmp_path / "run")["generations"]
    assert (generation["n_candidates"], generation["n_rejected"]) == (4, 0)


BEGIN = """
import os, runpy, sys
from pathlib import Path

Path("pid").write_text(str(os.getpid()))
runpy.run_module("core.run", run_name="__main__", alter_sys=True)
"""


@pytest.mark.thorough
def test_a_request_under_way_at_a_kill_is_asked_once_more_and_an_answered_one_is_not(
    tmp_path,
):
    """The server kills the run at its second request, when the answer to the first is stored."""
    folder = tmp_path / "run"
    words = [
        *COMMON,
        "budget=tiny",
        "budget.n_agent=3",
        "executor.workers=1",
    ]

    def script(call):
        if len(server.calls) == 2:
            wait_for_a_stored_reply(folder)
            os.kill(int((tmp_path / "pid").read_text()), signal.SIGKILL)
            return Reset()
        return Say(json.dumps({"strategies": [SOLUTION]}))

    with serving(script) as server:
        address = f"vlm.api_base={server.url}"
        model = ["vlm=gemini", "vlm.concurrency=1", address]
        command = ["-c", BEGIN, *model, *words, f"hydra.run.dir={folder}"]
        killed = warm_python(command, tmp_path, os.environ)
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        assert len(server.calls) == 2
        resume(folder, [address])
    first, *seeds = [call.body["generationConfig"]["seed"] for call in server.calls]
    assert first not in seeds
    assert len(seeds) == 3
    assert seeds[0] == seeds[1] != seeds[2]
    (generation,) = result(folder)["generations"]
    assert (generation["n_candidates"], generation["n_rejected"]) == (3, 0)


def wait_for_a_stored_reply(folder):
    until = time.monotonic() + 120
    while time.monotonic() < until:
        with closing(sqlite3.connect(folder / "run.sqlite")) as database:
            ((stored,),) = database.execute("SELECT count(*) FROM replies").fetchall()
        if stored:
            return
        time.sleep(0.02)
    raise AssertionError("no reply was stored")


@pytest.mark.thorough
def test_a_gateway_that_repeats_the_key_leaves_it_nowhere(tmp_path, monkeypatch, capfd):
    """The key ends in a line break; it is repeated in the tool's name, in the model's, and in an error."""
    key = "sk-planted0123456789"

    def script(call):
        sent = call.headers["authorization"]
        assert sent == f"Bearer {key}"
        design = SOLUTION | {"tool_name": f"rod {sent}", "tool_description": quote(key)}
        if len(server.calls) > 1:
            return Send(json.dumps({"error": {"message": f"no, {sent!r}"}}), 401)
        answer = document(Say(json.dumps({"strategies": [design]})), call)
        return Send(json.dumps(answer | {"model": f"m {sent}\x1b[2J"}))

    words = [
        *COMMON,
        "budget=tiny",
        "budget.n_agent=2",
    ]
    monkeypatch.setenv("OPENAI_API_KEY", f"{key}\r\n")
    with serving(script) as server:
        run(
            load("config", ["vlm=openai", *words, f"vlm.api_base={server.url}/v1"]),
            tmp_path / "run",
        )
    written = [
        file.read_bytes() for file in (tmp_path / "run").rglob("*") if file.is_file()
    ]
    written.append("".join(capfd.readouterr()).encode())
    assert len(written) > 10
    for form in (key, "planted"):
        assert not [data for data in written if form.encode() in data]
    assert any(b"***" in data for data in written)


def test_a_run_asks_once_for_lessons_and_keeps_them_within_bounds(tmp_path):
    folder = tmp_path / "run"
    lesson = {
        "says": "Hook the cube from behind. " * 40,
        "for": "pulling",
        "sure": "seen once",
        "seen": ["g0-a0-s0-p0", "g9-a9-s9-p9", 3],
        "run": "rm -rf /",
    }
    words = [
        *COMMON,
        "prompt.lessons=write",
        "budget=tiny",
    ]

    def answer(call):
        if "The search is over" in "".join(call.texts):
            said = json.dumps({"lessons": [lesson] * 30})
            return Say(f"Here they are:\n```json\n{said}\n```\nGood luck!")
        return Say(json.dumps({"strategies": [SOLUTION]}))

    with serving(answer) as server:
        model = ["vlm=gemini", f"vlm.api_base={server.url}", "vlm.concurrency=1"]
        run(load("config", [*model, *words]), folder)
    assert len(server.calls) == 2
    asked = "".join(server.calls[1].texts)
    assert "g0-a0-s0-p0" in asked
    assert "response_json_schema" not in server.calls[1].body["generationConfig"]
    written = json.loads((folder / "lessons.json").read_text())
    assert (written["task"], written["context"]) == ("BringCube", "source")
    assert len(written["lessons"]) == 12
    first = written["lessons"][0]
    assert sorted(first) == ["for", "says", "seen", "sure"]
    assert len(first["says"]) <= 400
    assert first["seen"] == ["g0-a0-s0-p0"]
    with closing(sqlite3.connect(folder / "run.sqlite")) as database:
        ids = database.execute("SELECT id FROM requests ORDER BY 1").fetchall()
    assert ids == [("g0-a0",), ("g1-lessons",)]
    # The user's to edit: an end that comes again leaves them.
    (folder / "lessons.json").write_text('{"lessons": ["mine"]}')
    again = ["budget.n_iteration=0", f"vlm.api_base={server.url}"]
    resume(folder, again)
    assert json.loads((folder / "lessons.json").read_text()) == {"lessons": ["mine"]}


@pytest.mark.parametrize("shown", rare(["lessons", "examples"], "lessons"))
@pytest.mark.thorough
def test_a_run_that_is_shown_what_others_taught_ends_and_writes_no_lessons(
    shown, tmp_path
):
    kept = {"says": "Pull from behind.", "for": "pulling", "sure": "seen", "seen": []}
    lessons = {"task": "OneBook", "context": "source", "lessons": [kept]}
    words = [
        *COMMON,
        "budget=tiny",
    ]
    folder = tmp_path / "run"
    answer = Say(json.dumps({"strategies": [SOLUTION]}))
    with serving(lambda call: answer) as server:
        model = ["vlm=gemini", f"vlm.api_base={server.url}", "vlm.concurrency=1"]
        run(load("config", [*model, *words]), tmp_path / "earlier")
        (tmp_path / "earlier/lessons.json").write_text(json.dumps(lessons))
        given = f"prompt.{shown}=[{tmp_path / 'earlier'}]"
        run(load("config", [*model, *words, given]), folder)

    assert len(server.calls) == 2
    assert (folder / "result.json").exists()
    assert not (folder / "lessons.json").exists()


def test_lessons_that_can_not_be_read_cost_no_run(tmp_path, capsys):
    folder = tmp_path / "run"
    words = [
        *COMMON,
        "prompt.lessons=write",
        "budget=tiny",
    ]

    def answer(call):
        if "The search is over" in "".join(call.texts):
            return Say("I learnt {nothing}.")
        return Say(json.dumps({"strategies": [SOLUTION]}))

    with serving(answer) as server:
        model = ["vlm=gemini", f"vlm.api_base={server.url}", "vlm.concurrency=1"]
        found = run(load("config", [*model, *words]), folder)
    assert found.best.reward > 0.95
    assert "no lessons.json: the answer is no JSON" in capsys.readouterr().err
    assert not (folder / "lessons.json").exists()
    assert (folder / "result.json").exists()


def test_a_model_without_words_is_not_asked_for_lessons(tmp_path):
    words = [*COMMON, "vlm=offline", "prompt.lessons=write"]
    with pytest.raises(UserError, match="writes no lessons; leave"):
        run(load("config", words), tmp_path / "run")
    with pytest.raises(
        UserError, match=r"give write, or folders as in prompt\.lessons"
    ):
        run(load("config", [*COMMON, "prompt.lessons=3"]), tmp_path / "run")
