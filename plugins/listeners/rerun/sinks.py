"""The sinks of a recording: a file, and viewers that show it as it grows. A viewer opened here listens on this machine
only.
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import SplitResult, urlsplit

from core.errors import UsageError
from plugins.listeners.rerun.view import HERE, listens, start_viewer

PORT = 9876  # Rerun's own
_WAIT_S = 15.0
_SCREEN_S = 1.0  # it listens before it looks for a screen, and ends if there is none


def address(where: int | str) -> SplitResult:
    """Read an address: ``PORT``, ``HOST:PORT``, or ``rerun+http://HOST:PORT/proxy``.

    Raises:
        UsageError: it is none of these.
    """
    text = str(where).strip()
    place = f"{HERE}:{text}" if text.isdigit() else text
    url = place if "://" in place else f"rerun+http://{place}/proxy"
    try:
        parts = urlsplit(url)
        if parts.hostname and parts.port and parts.scheme in ("rerun", "rerun+http", "rerun+https"):
            return parts
    except ValueError:
        pass
    raise UsageError(
        f"listener.rerun.connect can't be {text!r}; it is HOST:PORT, a port of this machine, or "
        "rerun+http://HOST:PORT/proxy"
    )


def sinks(file: Path, spawn: bool, connect: SplitResult | None, say: Callable[[str], None]) -> dict[str, Any]:
    """The file, and the viewers that listen, by their names in messages."""
    import rerun as rr

    targets: dict[str, Any] = {str(file): rr.FileSink(file)}
    viewers = []
    if connect is not None:
        if listens(connect.port or 0, connect.hostname or HERE):
            viewers.append(connect)
        else:
            say(f"no viewer listens at {connect.hostname}:{connect.port}")
    if spawn:
        if listens(PORT) or _opened():
            viewers.append(address(PORT))
        else:
            say("no viewer can be opened here (is there a screen?)")
    for viewer in viewers:
        name = f"the viewer at {viewer.hostname}:{viewer.port}"
        targets[name] = rr.GrpcSink(viewer.geturl())
        say(f"the recording goes to {name} too")
    return targets


def _opened() -> bool:
    """Open a viewer, which outlives the run; True if that succeeded."""
    viewer = start_viewer("--port", str(PORT), "--expect-data-soon")
    deadline = time.monotonic() + _WAIT_S
    while not listens(PORT):
        if viewer.poll() is not None or time.monotonic() > deadline:
            return False
        time.sleep(0.1)
    try:
        viewer.wait(_SCREEN_S)
    except subprocess.TimeoutExpired:
        return True
    return False
