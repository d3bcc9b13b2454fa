"""Looking at a recording: a page served on this machine only, until an interrupt; what is said when it can't be."""

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from urllib.parse import parse_qs, urlsplit

import pytest
import rerun as rr

from plugins.results.view import free_port, listens, recordings
from tests.support.commands import python_m


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    with rr.RecordingStream("vlmgineer") as stream:
        stream.save(folder / "recording.rrd")
        stream.log("text", rr.TextDocument("something to see"), static=True)
    return folder


def view(*words, **environment):
    return subprocess.Popen(
        [sys.executable, "-m", "core", "view", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
    )


def test_the_page_is_served_here_and_nowhere_else_until_an_interrupt(folder):
    viewer = view(folder, "web=true", "port=0")
    try:
        address = urlsplit(viewer.stdout.readline().strip())
        assert (address.scheme, address.hostname) == ("http", "127.0.0.1")
        data = urlsplit(parse_qs(address.query)["url"][0])
        assert (data.scheme, data.hostname, data.path) == (
            "rerun+http",
            "127.0.0.1",
            "/proxy",
        )
        with urllib.request.urlopen(address.geturl(), timeout=30) as page:
            assert page.status == 200
            assert b"re_viewer" in page.read()
        for port in (address.port, data.port):
            assert listens(port)
            assert not any(listens(port, host) for host in elsewhere())
        viewer.send_signal(signal.SIGINT)
        _, said = viewer.communicate(timeout=30)
    finally:
        viewer.kill()
    assert viewer.returncode == 0
    assert said == "Ctrl-C ends it\n"
    assert all(closes(port) for port in (address.port, data.port))


def closes(port):
    """The signal has been sent to the server's own child too, which may need a moment."""
    deadline = time.monotonic() + 10
    while listens(port) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not listens(port)


def elsewhere():
    """This machine's other addresses: loopback has a whole range."""
    named = socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)
    return {str(entry[4][0]) for entry in named} - {"127.0.0.1"} | {"127.0.0.2"}


def test_a_taken_port_is_one_line(folder):
    with socket.socket() as door:
        door.bind(("127.0.0.1", 0))
        door.listen()
        port = door.getsockname()[1]
        viewer = view(folder, "web=true", f"port={port}")
        out, said = viewer.communicate(timeout=60)
    assert (viewer.returncode, out) == (1, "")
    (line,) = said.splitlines()
    assert f"port {port} of 127.0.0.1 is not free" in line
    assert "port=0" in line


def test_without_a_screen_it_says_what_to_do(folder):
    viewer = view(folder, DISPLAY="", WAYLAND_DISPLAY="", WAYLAND_SOCKET="")
    _, said = viewer.communicate(timeout=60)
    assert viewer.returncode == 1
    (line,) = said.splitlines()
    assert line.startswith("error: there is no screen here; add web=true")


def test_the_page_takes_its_data_from_the_port_that_is_asked_for(folder):
    port = free_port()
    viewer = view(folder, "web=true", "port=0", f"web_port={port}")
    try:
        address = urlsplit(viewer.stdout.readline().strip())
        assert urlsplit(parse_qs(address.query)["url"][0]).port == port
        viewer.send_signal(signal.SIGINT)
        viewer.communicate(timeout=30)
    finally:
        viewer.kill()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "0 run folders given; one is needed; usage: vlmgineer view FOLDER"),
        (["nowhere"], "no run folder nowhere"),
        (["runs=nowhere"], "no run folder nowhere"),
        (["."], ". holds no recording.rrd; runs with the listener rerun write one"),
        (
            [".", "wbe=true"],
            "no setting 'wbe' in view (did you mean 'web'?); possible: port, web, web_port",
        ),
        ([".", "port=high"], "setting 'port' can't be 'high'"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, words, said):
    done = python_m(tmp_path, "core", "view", *words)
    assert done.returncode in (1, 2)
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert said in line


def test_recordings_of_a_run_or_of_a_multirun(folder, tmp_path):
    assert recordings(folder) == [folder / "recording.rrd"]
    for job in ("0_seed=0", "1_seed=1"):
        (tmp_path / job).mkdir()
        (tmp_path / job / "recording.rrd").touch()
    assert [found.parent.name for found in recordings(tmp_path)] == [
        "0_seed=0",
        "1_seed=1",
    ]


def test_a_free_port_can_be_listened_on():
    port = free_port()
    assert not listens(port)
    assert free_port(port) == port
