"""``vlmgineer report RUN watch=true``: serve the page of a run on this machine, while it goes on and after.

The server is a process of its own, at the lowest priority. It writes nothing, and reads the store through its one
reader, as far as the run has come.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

from core.errors import UserError
from core.store.reader import RunCost, StoredRun
from core.support.cli import say
from core.support.files import read_untrusted
from plugins.results.pages.runs import FinishedRun, read_run, read_so_far, reasons
from plugins.results.report.contents import Live, contents
from plugins.results.report.results import Results

HERE, PORT = "127.0.0.1", 8080
MAX_BYTES = 100_000_000  # of a recording
REASONS = 5  # while there is no table of them
_TIMEOUT_S = 10.0  # of a browser that connects and asks for nothing
_TYPES = {"": "text/plain", ".html": "text/html", ".csv": "text/csv", ".png": "image/png", ".svg": "image/svg+xml"}


class WatchedRun:
    """A run, and the files of its report, which are made again when there is more to see.

    Raises:
        UserError: the folder holds no store, or one that can't be read; by each method.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._store = StoredRun(folder)
        self._lock = threading.Lock()
        self._state = ""
        self._files: dict[str, Callable[[], bytes]] = {}

    def state(self) -> str:
        """A word that changes when a generation or the run has ended, or the run goes on again."""
        ended = self._store.result()
        return f"{len(self._store.generations())} {'goes on' if ended is None else ended.stopped or 'ended'}"

    def read(self, path: str) -> bytes | None:
        """The content of a file of the report, or of a recording of the run; None: there is no such file."""
        with self._lock:
            state = self.state()
            if path == "state":
                return state.encode()
            if state != self._state:
                self._files, self._state = self._make(state), state
            return self._files[path]() if path in self._files else None

    def _make(self, state: str) -> dict[str, Callable[[], bytes]]:
        found = read_run(self.folder)
        run = found if isinstance(found, FinishedRun) else read_so_far(self.folder)
        status = self.status() if run is not None else [*self.status(), *reasons(self._store)[:REASONS]]
        title = f"{self._store.config().get('task', {}).get('name', 'Run')}: {self.folder.resolve().name}"
        files = contents(Results((run,) if run is not None else ()), self.folder, Live(title, status, state))
        for file in run.recordings().values() if run is not None else ():
            files[file.relative_to(self.folder).as_posix()] = partial(read_untrusted, file, MAX_BYTES)
        return files

    def status(self) -> list[str]:
        """How far the run has come, and what it has cost, in lines."""
        config, ended, evaluations = self._store.config(), self._store.result(), self._store.evaluations()
        most = config.get("budget", {}).get("n_iteration")
        of_all = "" if most is None else f" of {most + 1}"
        how = "goes on (or was killed)" if ended is None else "has ended"
        if ended is not None and ended.stopped:
            how = f"was stopped: {ended.stopped}"
        rejected, failed = (sum(e.status == status for e in evaluations) for status in ("rejected", "failed"))
        nothing = sum(e.status == "ok" and e.reward == 0 for e in evaluations)
        cost, limit = RunCost.of(self._store.requests()), config.get("vlm", {}).get("max_cost_usd")
        dollars = "no cost reported" if cost.cost_usd is None else f"{cost.cost_usd:.2f} USD"
        bound = "no limit is set" if limit is None else f"the limit is {limit:g} USD"
        return [
            f"The run {how}: {len(self._store.generations())}{of_all} generations done.",
            f"{len(evaluations)} candidates: {rejected} rejected, {failed} failed, {nothing} earned nothing.",
            f"{cost.requests} calls of the model, {cost.errors} of them failed; {dollars}, {bound}.",
        ]


class Server(ThreadingHTTPServer):
    """Serves a watched run to browsers on this machine, at ``address``.

    Raises:
        UserError: the port is taken.
    """

    daemon_threads = True

    def __init__(self, run: WatchedRun, port: int) -> None:
        self.run = run
        try:
            super().__init__((HERE, port), _Handler)
        except (OSError, OverflowError) as error:
            mend = "choose another with port=N, or any with port=0"
            raise UserError(f"port {port} of {HERE} is not free ({error}); {mend}") from error
        self.address = f"http://{HERE}:{self.server_port}/"

    def handle_error(self, *_: object) -> None:
        """Print nothing where a browser hangs up."""


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = _TIMEOUT_S

    def do_GET(self) -> None:
        """Answer with a file. A page of another site, whose name leads here, is refused by the name that it asks."""
        if self.headers.get("Host") not in {f"{name}:{self.server.server_port}" for name in (HERE, "localhost")}:
            return self._answer(HTTPStatus.FORBIDDEN, b"This page is for this machine alone.\n")
        path = unquote(self.path.partition("?")[0]).removeprefix("/") or "index.html"
        try:
            data = self.server.run.read(path)
        except UserError as error:
            return self._answer(HTTPStatus.SERVICE_UNAVAILABLE, f"{error}\n".encode(errors="backslashreplace"))
        if data is None:
            return self._answer(HTTPStatus.NOT_FOUND, b"There is no such file.\n")
        return self._answer(HTTPStatus.OK, data, _TYPES.get(Path(path).suffix, "application/octet-stream"))

    def _answer(self, status: HTTPStatus, data: bytes, kind: str = "text/plain") -> None:
        self.send_response(status)
        for name, value in (("Content-Type", f"{kind}; charset=utf-8"), ("Content-Length", str(len(data)))):
            self.send_header(name, value)
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def watch(folder: Path, port: int) -> None:
    """Serve the page of a run until an interrupt comes.

    Raises:
        UserError: the folder holds no run that can be read, or the port is taken.
    """
    run = WatchedRun(folder)
    run.state()
    if hasattr(os, "nice"):
        os.nice(19)  # a run that goes on comes first
    with Server(run, port) as server:
        try:
            say(server.address)
            sys.stdout.flush()
            server.serve_forever()
        except KeyboardInterrupt:
            say(f"{server.address} has ended", file=sys.stderr)
