"""``vlmgineer mcp KEY=VALUE ...``: a run that an agent drives by the Model Context Protocol."""

from __future__ import annotations

import logging
import os
import secrets
import shlex
import signal
import socket
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from core.errors import UsageError, UserError
from core.support.cli import answer_help, read_path, say
from core.support.text import clean
from plugins.agents.bench import Bench, open_bench

USAGE = """usage: vlmgineer mcp [folder=FOLDER] [port=N] [GROUP=NAME | KEY=VALUE ...]
       vlmgineer mcp resume=RUN_DIR [port=N]

A server of the Model Context Protocol: an agent looks, checks, tries and watches by its calls, and drives a run.
The words are those of python -m core.run. With folder=FOLDER the run lies there, and goes on where it was.
Without port=N the server speaks over standard input and output; with it, over HTTP at 127.0.0.1, with a token."""

TOKEN = "VLMGINEER_MCP_TOKEN"  # noqa: S105  # the name of a variable
_FLUSH_S = 2.0  # for the last answers


def main(words: list[str]) -> int | None:
    """Serve an agent until it leaves.

    Raises:
        UserError: the package of the protocol is missing, or the run can't be started.
        KeyboardInterrupt: a server over HTTP was ended; says how to go on.
    """
    words = answer_help(USAGE, words)
    folder, port, words = _take_words(words)
    streams = None if port is not None else _take_streams()
    bench = open_bench(_interrupt)
    server = _start_server(bench, port, streams)

    try:
        # They take seconds to import, and a client waits for its first answer.
        from core.run import main as run_main
        from plugins.agents.choosing import choose_run

        run_main(choose_run(folder, words))
        bench.serve()
    except KeyboardInterrupt:
        hints = _hints(bench)
        if streams is None:
            raise KeyboardInterrupt(*hints) from None
        say("; ".join(["the agent has left", *hints]), file=sys.stderr)
    except BaseException as error:
        if bench.end(clean(str(error), 1000) or "the run has ended"):
            server.join(_FLUSH_S)
        raise

    return 0


def _interrupt() -> None:
    """Interrupt the main thread, as a person would."""
    os.kill(os.getpid(), signal.SIGINT)


def _hints(bench: Bench) -> list[str]:
    """Say how to go on with a run that has not come to its end; none: it has, or did not begin."""
    if bench.folder is None or bench.has_ended:
        return []
    return [f"to go on: vlmgineer mcp resume={shlex.quote(str(bench.folder))}"]


# --- words --------------------------------------------------------------------------------------------------------


def _take_words(words: Sequence[str]) -> tuple[Path | None, int | None, list[str]]:
    """Take this command's own words out of the others: the folder, the port."""
    folder: Path | None = None
    port: int | None = None
    others = []
    for word in words:
        key, _, value = word.partition("=")
        if word.startswith("-"):
            raise UsageError(f"{word}: an agent drives one run, without flags\n{USAGE}")
        if key == "folder":
            folder = read_path(value)
        elif key == "port":
            port = _read_port(value)
        else:
            others.append(word)

    return folder, port, others


def _read_port(value: str) -> int:
    if not value.isdecimal() or not 0 <= int(value) < 2**16:
        raise UsageError(
            f"port must be from 0 (any that is free) to 65535, got {value!r}"
        )
    return int(value)


# --- the server ---------------------------------------------------------------------------------------------------


def _take_streams() -> tuple[BinaryIO, BinaryIO]:
    """Take standard input and output for the protocol alone.

    What engines and libraries print to file descriptor 1, in this process and in workers, goes to standard error.
    """
    sys.stdout.flush()
    incoming = os.fdopen(os.dup(0), "rb")
    outgoing = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return incoming, outgoing


def _start_server(
    bench: Bench, port: int | None, streams: tuple[BinaryIO, BinaryIO] | None
) -> threading.Thread:
    """Serve in a thread of its own: over the streams, or else over HTTP.

    Raises:
        UserError: the package of the protocol is missing, or the port is taken.
    """
    target: Callable[[], None]
    try:
        if streams is None:
            from plugins.agents.web import build_app

            assert port is not None
            target = _prepare_http(build_app, bench, port)
        else:
            from plugins.agents.server import serve_streams

            target = partial(serve_streams, bench, *streams)
    except ImportError as error:
        raise UserError(
            f"vlmgineer mcp needs the package mcp: pip install 'mcp>=2.3,<3' ({error})"
        ) from error

    logging.getLogger("mcp").setLevel(logging.ERROR)  # a flood of nonsense is no news
    thread = threading.Thread(target=target, name="protocol", daemon=True)
    thread.start()
    return thread


def _prepare_http(
    build_app: Callable[[Bench, str], Any], bench: Bench, port: int
) -> Callable[[], None]:
    """Open a port of this machine alone, say where the server is, and return what serves there."""
    import uvicorn

    token = os.environ.get(TOKEN) or secrets.token_urlsafe(24)
    door = socket.socket()
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        door.bind(("127.0.0.1", port))
        door.listen()  # who reads the address may come before the server is up
    except OSError as error:
        raise UserError(f"port={port} can't be used: {error.strerror}") from error

    app = build_app(bench, token)
    server = uvicorn.Server(uvicorn.Config(app, log_level="error", access_log=False))
    say(f"http://127.0.0.1:{door.getsockname()[1]}/mcp", file=sys.stderr)
    known = f"the one in {TOKEN}" if TOKEN in os.environ else token
    say(f"Authorization: Bearer TOKEN, and the token is {known}", file=sys.stderr)
    return partial(server.run, sockets=[door])
