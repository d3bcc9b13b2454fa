"""A run is watched while it goes on: its page is for this machine alone, and its folder stays as it is."""

import http.client
import threading
import time
from contextlib import contextmanager

import pytest

from core.errors import UserError
from core.events import Generation
from core.store.database import is_held
from plugins.results.report.command import main
from plugins.results.report.watch import HERE, Server
from tests.core.browser import complaints, opened
from tests.core.run_folders import edit, hook, write_run
from tests.plugins.results.pages.test_page import HOSTILE
from tests.plugins.results.pages.test_runs import folder_state

pytestmark = pytest.mark.slow


@contextmanager
def served(folder):
    with Server(folder, 0) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def get(server, path="/", host=None, method="GET"):
    """The status and the content."""
    connection = http.client.HTTPConnection(HERE, server.server_port, timeout=30)
    connection.request(method, path, headers={"Host": host or f"{HERE}:{server.server_port}"})
    answer = connection.getresponse()
    return answer.status, answer.read().decode(errors="replace")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("watched") / "run"
    tools = [hook(0.2, "short hook", "A hook, quite short"), hook(0.4, HOSTILE)]
    write_run(folder, rewards=[[0.2, None, 0.0], [0.5, 0.7]], tools=tools, name=HOSTILE, cost_usd=0.25)
    (folder / "best").mkdir()
    (folder / "best/rollout.gif").write_bytes(b"GIF89a")
    return folder


def test_the_page_follows_a_run_that_goes_on(tmp_path):
    folder = write_run(
        tmp_path / "run", "vlm=gemini", "vlm.max_cost_usd=3", rewards=[[0.4, None]], cost_usd=0.25, finish=False
    )
    with served(folder) as server:
        _, page = get(server)
        for said in (
            "goes on",
            "1 of 4 generations",
            "2 candidates: 1 rejected",
            "1 calls",
            "0.25 USD, the limit is 3 USD",
        ):
            assert said in page, said
        assert "it is too heavy" in page
        assert "1 of 4 generations" in get(server, "/state")[1]
        write_run.open[-1].hook.generation_finished(generation=Generation(1, ()))
        assert "2 of 4 generations" in get(server, "/state")[1]
        assert "2 of 4 generations" in get(server)[1]
        assert is_held(folder)
        before = folder_state(folder)
        assert "The run goes on: " in get(server)[1]
        assert folder_state(folder) == before
        write_run.open[-1].hook.run_ended()  # as when the process is gone, its lock is free and there is no result
        assert f"The run was killed (to go on: python -m core.run resume={folder}): 2 of 4" in get(server, "/state")[1]
        assert "The run was killed" in get(server)[1]


@pytest.mark.parametrize(("rewards", "said"), [([], "0 of 4 generations"), ([[None, None]], "it is too heavy")])
def test_there_is_a_page_before_anything_earned_a_reward(tmp_path, rewards, said):
    folder = write_run(tmp_path / "run", rewards=rewards, finish=False)
    (folder / "task.yaml").write_text("name: TurnGate\n")  # as of a scene file
    with served(folder) as server:
        page = get(server)[1]
        assert said in page
        assert "<h1>TurnGate: run</h1>" in page


def test_other_names_and_other_files_are_refused(finished):
    with served(finished) as server:
        assert get(server, host=f"localhost:{server.server_port}")[0] == 200
        for host in ("evil.example", f"evil.example:{server.server_port}", HERE, f"{HERE}:1"):
            assert get(server, host=host) == (403, "This page is for this machine alone.\n")
        for path in (
            "/run.sqlite",
            "/../run.sqlite",
            "/%2e%2e/run/run.sqlite",
            "/data/../run.sqlite",
            "//etc/passwd",
            "/x",
        ):
            assert get(server, path)[0] == 404, path
        assert get(server, method="POST")[0] == 501


def test_a_film_that_is_a_link_out_of_the_folder_is_not_shown(finished, tmp_path):
    folder = write_run(tmp_path / "run")
    (folder / "best").symlink_to(finished / "best")
    with served(folder) as server:
        assert "data:image/gif" not in get(server)[1]
        assert get(server, "/best/rollout.gif")[0] == 404


def test_a_store_that_breaks_is_said(tmp_path):
    folder = write_run(tmp_path / "run")
    with served(folder) as server:
        edit(folder, "UPDATE generations SET summary = '{'")
        assert get(server)[0] == 503
        assert "run.sqlite can't be read: row 0 of generations" in get(server)[1]


def test_mistakes_are_one_line(finished, tmp_path, monkeypatch):
    monkeypatch.setattr("os.nice", lambda _: 0)
    for words, said in (([], "0 folders given"), ([finished, finished], "2 folders"), ([tmp_path], "holds no run")):
        with pytest.raises(UserError, match=said):
            main([*map(str, words), "watch=true"])
    with served(finished) as server, pytest.raises(UserError, match=f"port {server.server_port} .* is not free"):
        main([str(finished), "watch=true", f"port={server.server_port}"])


def assert_shown(chrome, text):
    """Check that the page comes to have a text: a driver may return before its browser has the page."""
    deadline = time.monotonic() + 20
    while text not in chrome.page_source and time.monotonic() < deadline:
        time.sleep(0.2)
    assert text in chrome.page_source


def test_a_browser_shows_the_page_and_loads_it_again_when_a_generation_has_ended(tmp_path):
    folder = write_run(tmp_path / "run", rewards=[[0.2, 0.4]], finish=False)
    (tmp_path / "blank.html").write_text("<!DOCTYPE html>")
    with served(folder) as server, opened(tmp_path / "blank.html") as chrome:
        chrome.get(server.address)
        assert_shown(chrome, "1 of 4 generations")
        write_run.open[-1].hook.generation_finished(generation=Generation(1, ()))
        assert_shown(chrome, "2 of 4 generations")
        assert complaints(chrome) == []
