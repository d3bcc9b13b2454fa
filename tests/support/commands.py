"""Call commands as a user does.

Most are started in a fork of one warm process per test session (`main` below), which has imported what commands
import: that saves two seconds of processor time each.
"""

import atexit
import contextlib
import gc
import importlib
import json
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
import tempfile
import threading
from functools import cache
from pathlib import Path

from core.errors import UserError

ROOT = Path(__file__).parents[2]


def python_m(folder, *words, **environment):
    """Run ``python -m`` with these words in a folder, with more in the environment."""
    return warm_python(["-m", *map(str, words)], folder, os.environ | environment)


def warm_python(words, folder, environment, timeout=240):
    """Run ``python -m MODULE ...`` or ``python -c CODE ...`` in a fork of the warm process.

    Returns:
        a `subprocess.CompletedProcess` with text.
    """
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        warm, pipe = _warm()
        files = [f"/proc/{os.getpid()}/fd/{file.fileno()}" for file in (out, err)]
        order = {
            "words": words,
            "folder": str(folder),
            "environment": dict(environment),
            "files": files,
        }
        warm.stdin.write(json.dumps({**order, "timeout": timeout}) + "\n")
        warm.stdin.flush()
        status = json.loads(pipe.readline())
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(
            [sys.executable, *words], status, out.read(), err.read()
        )


@cache
def _warm():
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "tests.support.commands", str(writing)]
    warm = subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, text=True, pass_fds=[writing]
    )
    os.close(writing)
    atexit.register(warm.wait)
    atexit.register(warm.stdin.close)  # before the line above, in the reverse order
    return warm, os.fdopen(reading)


def main(answers: int) -> None:
    """Serve orders from standard input, one after the other, each in a fork."""
    from core.plugins import installed
    from plugins.executors import local

    for kind, name in installed().offers:
        with contextlib.suppress(ImportError, UserError):
            installed().factory(kind, name)
    for module in (
        "core.search.orchestration",
        "core.config.compose",
        "hydra",
        "core.simulation.play",
        "rerun",
    ):
        importlib.import_module(module)
    installed.cache_clear()
    local._spawn = multiprocessing.get_context("fork")  # workers are warm too
    gc.freeze()
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            os.close(answers)
            order = json.loads(line)
            with contextlib.ExitStack() as ended:
                ended.callback(os._exit, 1)
                os._exit(begin(**order))
        _, status = os.waitpid(child, 0)
        os.write(answers, f"{os.waitstatus_to_exitcode(status)}\n".encode())


def begin(words, folder, environment, files, timeout) -> int:
    """Become the process that was ordered; return its exit status."""
    os.setsid()
    signal.alarm(timeout)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    nowhere = os.open(os.devnull, os.O_RDONLY)
    for number, file in enumerate(
        [nowhere, *(os.open(name, os.O_WRONLY | os.O_APPEND) for name in files)]
    ):
        os.dup2(file, number)
    sys.stdin, sys.stdout, sys.stderr = (
        os.fdopen(number, "rw"[number > 0], closefd=False) for number in range(3)
    )
    sys.__stdin__, sys.__stdout__, sys.__stderr__ = sys.stdin, sys.stdout, sys.stderr
    sys.path[0] = "" if words[0] == "-c" else folder
    sys.path[1:1] = [
        path for path in environment.get("PYTHONPATH", "").split(":") if path
    ]
    kind, target, *sys.argv[1:] = words
    try:
        if kind == "-c":
            sys.argv[0] = "-c"
            exec(compile(target, "<string>", "exec"), vars(sys.modules["__main__"]))
        else:
            sys.modules.pop(target, None)  # else runpy warns
            runpy.run_module(target, run_name="__main__", alter_sys=True)
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        sys.excepthook(*sys.exc_info())
        status = 1
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    return status


if __name__ == "__main__":
    main(int(sys.argv[1]))
