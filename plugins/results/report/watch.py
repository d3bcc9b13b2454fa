"""``vlmgineer report RUN watch=true``: serve the page of a run on this machine, while it goes on and after.

The server is a process of its own, at the lowest priority; it writes nothing.
"""

from __future__ import annotations

import os
import shlex
import sys
import threading
from collections.abc import Callable
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

from core.errors import UserError
from core.store.database import is_held
from core.store.reader import StoredRun
from core.support.cli import say
from core.support.files import read_untrusted
from plugins.results.pages.runs import FinishedRun, read_run, read_so_far, reasons
from plugins.results.report.contents import contents
from plugins.results.report.results import Results
from plugins.results.report.statistics import RunCost

HERE, PORT = "127.0.0.1", 8080
MAX_BYTES = 100_000_000  # of a recording
REASONS = 5  # while there is no table of them
_TYPES = {"": "text/plain", ".html": "text/html", ".csv": "text/csv", ".png": "image/png", ".svg": "image/svg+xml"}


class Server(ThreadingHTTPServer):
    """Serves the report of a run to browsers on this machine, at ``address``; made again when there is more to see.

    Raises:
        UserError: the folder holds no store that can be read, or the port is taken.
    """

    daemon_threads = True

    def __init__(self, folder: Path, port: int) -> None:
        self._folder, self._store, self._lock = folder, StoredRun(folder), threading.Lock()
        self._made, self._files = "", dict[str, Callable[[], bytes]]()
        self.state()
        try:
            super().__init__((HERE, port), _Handler)
        except (OSError, OverflowError) as error:
            mend = "choose another with port=N, or any with port=0"
            raise UserError(f"port {port} of {HERE} is not free ({error}); {mend}") from error
        self.address = f"http://{HERE}:{self.server_port}/"

    def handle_error(self, *_: object) -> None:
        """Print nothing where a browser hangs up."""

    def state(self) -> str:
        """How far the run has come: another text when a generation or the run has ended, or goes on again."""
        ended, most = self._store.result(), self._store.config().get("budget", {}).get("n_iteration")
        stopped = f"was killed (to go on: python -m core.run resume={shlex.quote(str(self._folder))})"
        how = "has ended" if ended is not None else "goes on" if is_held(self._folder) else stopped
        how = f"was stopped ({ended.stopped})" if ended is not None and ended.stopped else how
        done = len(self._store.generations())
        return f"The run {how}: {done}{'' if most is None else f' of {most + 1}'} generations done."

    def read(self, path: str) -> bytes | None:
        """The content of a file of the report, or of a recording of the run; None: there is no such file."""
        with self._lock:
            state = self.state()
            if path == "state":
                return state.encode()
            if state != self._made:
                self._files, self._made = self._make(state), state
            return self._files[path]() if path in self._files else None

    def _make(self, state: str) -> dict[str, Callable[[], bytes]]:
        found, config, evaluations = read_run(self._folder), self._store.config(), self._store.evaluations()
        run = found if isinstance(found, FinishedRun) else read_so_far(self._folder)
        rejected, failed = (sum(e.status == status for e in evaluations) for status in ("rejected", "failed"))
        nothing = sum(e.status == "ok" and e.reward == 0 for e in evaluations)
        cost, limit = RunCost.of(self._store.requests()), config.get("vlm", {}).get("max_cost_usd")
        dollars = "no cost reported" if cost.cost_usd is None else f"{cost.cost_usd:.2f} USD"
        bound = "no limit is set" if limit is None else f"the limit is {limit:g} USD"
        status = [
            state,
            f"{len(evaluations)} candidates: {rejected} rejected, {failed} failed, {nothing} earned nothing.",
            f"{cost.requests} calls of the model, {cost.errors} of them failed; {dollars}, {bound}.",
            *(reasons(self._store)[:REASONS] if run is None else ()),
        ]
        title = f"{found.task or 'Run'}: {self._folder.resolve().name}"
        files = contents(Results((run,) if run else ()), self._folder, title, status)
        recordings = run.recordings().values() if run else ()
        return files | {
            str(file.relative_to(self._folder)): partial(read_untrusted, file, MAX_BYTES) for file in recordings
        }


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = 10.0  # seconds that a browser may be silent

    def do_GET(self) -> None:
        """Answer with a file. A page of another site, whose name leads here, is refused by the name that it asks."""
        path = unquote(self.path.partition("?")[0]).removeprefix("/") or "index.html"
        if self.headers.get("Host") not in {f"{name}:{self.server.server_port}" for name in (HERE, "localhost")}:
            self._answer(403, b"This page is for this machine alone.\n")
            return
        try:
            found = self.server.read(path)
        except UserError as error:
            self._answer(503, f"{error}\n".encode(errors="backslashreplace"))
            return
        if found is None:
            self._answer(404, b"There is no such file.\n")
        else:
            self._answer(200, found, _TYPES.get(Path(path).suffix, "application/octet-stream"))

    def _answer(self, status: int, data: bytes, kind: str = "text/plain") -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def watch(folder: Path, port: int) -> None:
    """Serve the page of a run until an interrupt comes.

    Raises:
        UserError: as `Server`.
    """
    with Server(folder, port) as server:
        os.nice(19)  # a run that goes on comes first
        try:
            say(server.address)
            sys.stdout.flush()
            server.serve_forever()
        except KeyboardInterrupt:
            say(f"{server.address} has ended", file=sys.stderr)
