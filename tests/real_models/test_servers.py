"""Whole runs with real servers: prompt, answer, reading, trial, second generation, report, and resume after a kill.

A model of 135 million parameters designs little: what counts is that every answer is read or has its reason. Each test
prints a row of a table: server, requests, answers read, designs tried, reasons of the rest.
"""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import sys
import time
import urllib.request
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest

from tests.real_models.servers import (
    LLAMA,
    forward,
    llama_server,
    mock,
    proxy,
    transformers_server,
)

pytestmark = pytest.mark.real

ROOT = Path(__file__).parents[2]
SOLUTIONS = json.loads((ROOT / "tests/tasks/solutions/BringCube.json").read_text())
SOLUTION = SOLUTIONS["strategies"][0]

# The shortest prompt and the smallest answer: an agent, a tool, an action; two generations.
SMALL = [
    *("task=BringCube", "sim=mujoco", "film=false", "executor.workers=1"),
    *("budget=tiny"),
    *("budget.n_iteration=1", "prompt.picture=false", "prompt.feedback=paper"),
    *("prompt.repair=0", "vlm.concurrency=1", "vlm.timeout_s=1800"),
]
AT = ["vlm=litellm", "vlm.max_output_tokens=600"]


def start(*words):
    """Start a run as a user does."""
    command = [sys.executable, "-m", "core.run", *words]
    return subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def finish(process):
    """Wait for a run's end; return what it printed."""
    text, _ = process.communicate()
    print(text)
    return text


def rows(folder, query):
    with closing(sqlite3.connect(folder / "run.sqlite")) as database:
        return database.execute(query).fetchall()


def tell(server, folder):
    """Print a row of the table, and check that every answer was read or has its reason."""
    replies = rows(folder, "SELECT text, error FROM replies")
    tried = rows(folder, "SELECT status, reason FROM evaluations")
    answered = [text for text, error in replies if error is None]
    unread = [why for status, why in tried if why.startswith("the reply can't be read")]
    played = [status for status, _ in tried if status != "rejected"]
    reasons = Counter(why[:100] for status, why in tried if status == "rejected")
    reasons.update(error[:100] for _, error in replies if error is not None)
    read = len(answered) - len(unread)
    print(f"| {server} | {len(replies)} | {read} | {len(played)} | {dict(reasons)} |")

    assert len(replies) == 2
    assert len(tried) == 2
    assert all(why for status, why in tried if status == "rejected")


def report(folder):
    """Make the report of a run, as a user does; it has the run, or says why it leaves it out."""
    words = [sys.executable, "-m", "core", "report", str(folder)]
    words.append(f"output={folder.parent / 'report'}")
    subprocess.run(words, cwd=ROOT, check=False)  # fails, if nothing was tried
    pages = [*(folder.parent / "report").rglob("*.csv")]
    assert any(folder.name in page.read_text() for page in pages)


def check(server, folder, words, log_lines):
    """Make a run, and another that is killed after its first answer and resumed: no request is paid twice."""
    whole = folder / "whole"
    finish(start(*words, f"hydra.run.dir={whole}"))
    tell(server, whole)
    report(whole)

    killed = folder / "killed"
    before = len(log_lines())
    process = start(*words, f"hydra.run.dir={killed}")
    while not list(killed.glob("replies/*.txt")):
        assert process.poll() is None, finish(process)
        time.sleep(0.2)
    process.send_signal(signal.SIGKILL)
    process.wait()
    stored = len(rows(killed, "SELECT request_id FROM replies"))

    trusted = ("vlm.api_base=", "vlm.model=")
    repeated = [word for word in words if word.startswith(trusted)]
    finish(start(f"resume={killed}", *repeated))
    tell(f"{server}, killed and resumed", killed)
    answered = [line for line in log_lines()[before:] if "200" in line]
    print(f"{stored} of 2 answers were stored at the kill; {len(answered)} were paid")
    assert stored >= 1
    assert len(answered) <= 3  # the second may have been under way when it was killed


def test_llama_cpp(tmp_path):
    with llama_server(tmp_path) as server:
        words = [*SMALL, *AT, "vlm.model=openai/smollm2", f"vlm.api_base={server.url}"]
        check("llama-cpp-python", tmp_path, words, server.requests)


def test_a_context_that_is_too_small(tmp_path):
    with llama_server(tmp_path, context=1024) as server:
        words = [*SMALL, *AT, "vlm.model=openai/smollm2", f"vlm.api_base={server.url}"]
        said = finish(start(*words, f"hydra.run.dir={tmp_path / 'run'}"))
        assert "and the server holds 1024" in " ".join(said.split())
        assert len(server.requests()) <= 3  # with what is refused by name before


def test_litellm_proxy(tmp_path):
    with (
        llama_server(tmp_path) as behind,
        proxy(tmp_path, smollm2=forward(behind)) as server,
    ):
        words = [*SMALL, *AT, "vlm.model=openai/smollm2", f"vlm.api_base={server.url}"]
        check("LiteLLM's proxy", tmp_path, words, server.requests)


def test_answers_of_the_proxy_itself(tmp_path):
    """What a gateway answers without a model: designs, words without one, and its failures."""
    models = {
        "designs": mock(json.dumps({"strategies": [SOLUTION]})),
        "words": mock("A rod."),
        "limited": mock("litellm.RateLimitError"),
        "narrow": mock("litellm.ContextWindowExceededError"),
        "broken": mock("litellm.InternalServerError"),
    }
    with proxy(tmp_path, **models) as server:
        common = [*SMALL, *AT, f"vlm.api_base={server.url}"]
        for name in ("designs", "words"):
            words = [*common, f"vlm.model=openai/{name}"]
            check(f"LiteLLM's proxy, {name}", tmp_path / name, words, server.requests)

        said = {}
        asked = {}
        for name in ("limited", "narrow", "broken", "unknown"):
            before = len(server.requests())
            words = [*common, f"vlm.model=openai/{name}"]
            words.append(f"hydra.run.dir={tmp_path / name}")
            said[name] = " ".join(finish(start(*words)).split())
            asked[name] = len(server.requests()) - before

    rewards = rows(tmp_path / "designs/whole", "SELECT reward FROM evaluations")
    assert min(reward for (reward,) in rewards) > 0.9
    for (why,) in rows(tmp_path / "words/whole", "SELECT reason FROM evaluations"):
        assert why.startswith("the reply can't be read")

    assert "RateLimitError" in said["limited"]
    assert "the request is too long" in said["narrow"]
    assert "InternalServerError" in said["broken"]
    assert "unknown" in said["unknown"]
    assert asked == {"limited": 5, "narrow": 1, "broken": 5, "unknown": 1}


def test_transformers_serve(tmp_path):
    with transformers_server(tmp_path) as server:
        name = json.loads(_get(f"{server.url}/models"))["data"][0]["id"]
        words = [*SMALL, *AT, f"vlm.model=openai/{name}", f"vlm.api_base={server.url}"]
        check("transformers serve", tmp_path, words, server.requests)


def _get(url):
    with urllib.request.urlopen(url, timeout=60) as answer:
        return answer.read()


def ask_llm(folder, model):
    """Make a run whose model is the program ``llm``; return what the run printed."""
    command = f"vlm.command=[{LLAMA.program('llm')},-m,{model}]"
    words = [word for word in SMALL if not word.startswith("vlm.")]
    words += ["vlm=command", command, "vlm.timeout_s=1800"]
    return finish(start(*words, f"hydra.run.dir={folder}"))


def test_llm_as_a_program(tmp_path, monkeypatch):
    """``llm`` asks llama.cpp's server; its plugin with the weights has a context of 512 tokens, and says so."""
    monkeypatch.setenv("LLM_USER_PATH", str(tmp_path))
    with llama_server(tmp_path) as server:
        lines = ["- model_id: served", "  model_name: smollm2"]
        lines.append(f"  api_base: {server.url}")
        (tmp_path / "extra-openai-models.yaml").write_text("\n".join(lines) + "\n")
        ask_llm(tmp_path / "served", "served")

    tell("llm", tmp_path / "served")
    said = ask_llm(tmp_path / "carried", "SmolLM2")
    assert "exceed context window of 512" in " ".join(said.split())
