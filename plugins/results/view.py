"""``vlmgineer view FOLDER [web=true] [port=N] [web_port=N]``: show a run's recording in Rerun's viewer, in a window, or
with ``web=true`` in the browser. All ports are open to this machine only.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from core.errors import UsageError, UserError
from core.plugins import check_settings
from core.support.cli import say
from plugins.results.named_folders import folders_and_overrides

HERE = "127.0.0.1"
USAGE = (
    "usage: vlmgineer view FOLDER [web=true] [port=N] [web_port=N]; FOLDER, or runs=FOLDER, is a run's or a "
    "multirun's"
)
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
_END_S = 5.0


def recordings(run: Path) -> list[Path]:
    """The recordings in the folder of a run or a multirun.

    Raises:
        UserError: there is no recording.
    """
    if not run.is_dir():
        raise UserError(f"no run folder {run}")

    files = sorted(run.glob("recording*.rrd"))
    files += sorted(run.glob("*/recording*.rrd"))
    if not files:
        raise UserError(
            f"{run} holds no recording.rrd; runs with the listener rerun write one"
        )

    return files


def listens(port: int, host: str = HERE) -> bool:
    """True if a server listens on the port."""
    with socket.socket() as client:
        return client.connect_ex((host, port)) == 0


def free_port(wanted: int = 0, setting: str = "port") -> int:
    """The port ``wanted``, which a setting gave, or with 0 any free port.

    Raises:
        UserError: the port is taken.
    """
    try:
        with socket.create_server((HERE, wanted)) as server:
            return int(server.getsockname()[1])
    except (OSError, OverflowError) as error:
        mend = f"choose another with {setting}=N, or any with {setting}=0"
        raise UserError(
            f"port {wanted} of {HERE} is not free ({error}); {mend}"
        ) from error


def view(
    files: Sequence[Path], web: bool = False, port: int = 9090, web_port: int = 0
) -> None:
    """Show recordings until the window is closed or an interrupt comes, which is the usual end of a server.

    Args:
        files: the recordings.
        web: serve a page for the browser, in place of a window.
        port: of that page; 0: any that is free.
        web_port: from which that page takes its data; 0: any that is free.

    Raises:
        UserError: they can't be shown, there is no screen, or Rerun is not installed.
    """
    if not (web or _has_screen()):
        raise UserError("there is no screen here; add web=true, and open the page")

    page = free_port(port, "port") if web else 0
    data = free_port(web_port if web else 0, "web_port")
    words = [_find_viewer(), *map(str, files), "--port", str(data), "--bind", HERE]
    if web:
        words += ["--serve-web", "--web-viewer-port", str(page)]

    with contextlib.suppress(KeyboardInterrupt), tempfile.TemporaryFile() as output:
        viewer = subprocess.Popen(  # noqa: S603
            words, stdin=subprocess.DEVNULL, stdout=output, stderr=output
        )
        try:
            if web:
                _announce(viewer, page, data)

            status = viewer.wait()
        finally:
            viewer.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                viewer.wait(_END_S)

            viewer.kill()

        if web or status:
            output.seek(0)
            printed = output.read().decode(errors="replace").strip()
            last = (printed or "it printed nothing").splitlines()[-1]
            hint = "" if web else "; web=true needs no window"
            raise UserError(f"the viewer ended with status {status}: {last}{hint}")


def _has_screen() -> bool:
    """Report whether there is a screen, as far as Linux says by variables; other systems have one."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in _SCREENS)


def _find_viewer() -> str:
    """Return the program, in the package that Rerun's makers deliver it in.

    Raises:
        UserError: Rerun is not installed.
    """
    spec = importlib.util.find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise UserError("Rerun's viewer is not installed: pip install rerun-sdk")

    return str(Path(spec.origin).with_name("rerun"))


def _announce(viewer: subprocess.Popen[bytes], page: int, data: int) -> None:
    """Wait until a viewer serves its page and data, and print the address."""
    while viewer.poll() is None:
        if listens(page) and listens(data):
            break
        time.sleep(0.05)
    else:
        return

    # Before the address, whose reader may interrupt at once.
    say("Ctrl-C ends it", file=sys.stderr)
    source = quote(f"rerun+http://{HERE}:{data}/proxy", safe="")
    say(f"http://{HERE}:{page}/?url={source}")
    sys.stdout.flush()


def main(words: list[str]) -> None:
    folders, options = folders_and_overrides(USAGE, words)
    if len(folders) != 1:
        raise UsageError(f"{len(folders)} run folders given; one is needed; {USAGE}")

    given = dict(option.split("=", 1) for option in options)
    settings = check_settings(view, given, "view", {"files": None})
    view(recordings(folders[0]), **settings)
