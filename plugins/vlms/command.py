"""Ask any program that reads a prompt and prints an answer: a subscription's command line, a script, another tool."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import IO, Annotated

from core.designs.composer import as_markdown
from core.errors import UsageError, UserError, check_positive
from core.events import Run
from core.hooks import Names, hookimpl
from core.interfaces import VLM, Reply, Request
from core.support.secrets import holds_secret, is_secret_name, scrub
from core.support.text import clean
from core.values.messages import checked
from plugins.vlms.calls import Arrivals, Calls
from plugins.vlms.prompt_files import write_letter

MAX_BYTES = 20_000_000  # of an answer
_MAX_WORDS = 20_000  # bytes of what a program says on standard error
_SHOWN = 400  # characters of it that are shown
_END_S = 2.0  # so long a program that is stopped may take to end by itself
_FILE = "{prompt}"
_PICTURES = "{pictures}"


class Command(VLM):
    """Starts a program for each request, gives it the prompt, and takes what it prints as the answer.

    The program runs in a folder of its own, ``command/g0-a0`` in the run's folder, which holds ``prompt.md``, the
    pictures that it names, and ``schema.json``. It gets the prompt on standard input, or reads the file whose path
    stands in the place of ``{prompt}`` in its arguments. An argument ``{pictures}`` becomes the paths of all pictures.
    No shell reads the command.

    Args:
        command: the program and its arguments.
        timeout_s: the program is ended after so long.
        concurrency: programs that run at the same time.
        environment: names of variables with keys that the program gets; it gets no others.
        model: the name that is stored with replies; empty: the program's.

    Raises:
        UserError: there is no such program, or a setting can't be used.
    """

    repairs = True

    def __init__(
        self,
        command: Annotated[list[str], Names("program")] = [],  # noqa: B006 - read as a configuration's default
        timeout_s: float = 1800.0,
        concurrency: int = 2,
        environment: Annotated[list[str], Names("keys")] = [],  # noqa: B006
        model: str = "",
    ) -> None:
        check_positive("vlm.", timeout_s=timeout_s, concurrency=concurrency)
        if not command:
            raise UsageError(
                "vlm.command is empty; give a program and its arguments, such as 'vlm.command=[claude,-p]'"
            )
        if any(holds_secret(word) for word in command):
            raise UsageError(
                "vlm.command holds a key, and is stored with the run; put it into the environment, and name its "
                "variable in vlm.environment"
            )

        program = shutil.which(command[0])
        if program is None:
            raise UserError(
                f"vlm.command: there is no program {clean(command[0], 200)} here; give its path, or install it"
            )

        self.model = model or f"command {Path(program).name}"
        self._words = [str(Path(program).absolute()), *command[1:]]
        self._timeout_s = timeout_s
        self._environment = _keep_variables(environment)
        self._folder = Path("command")
        self._arrivals = Arrivals(self.model)
        self._calls = Calls(self.model, concurrency, self._answer, self._fail)

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._folder = run.folder / "command"

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`, and `Calls.replies`."""
        yield from self._calls.replies(requests, first=False)

    def _answer(self, request: Request, stop: threading.Event) -> Reply:
        """Run the program on a request.

        Args:
            request: whose folder is written.
            stop: set when nobody waits for the reply any more; it ends the program.

        Raises:
            UserError: the folder can't be written, or the program can't be started.
        """
        folder = (self._folder / request.id).absolute()
        prompt = "\n".join(as_markdown(message) for message in request.messages)
        try:
            write_letter(folder, request, prompt)
        except OSError as error:
            raise UserError(f"{folder} can't be written: {error}") from error

        hear = partial(self._arrivals.hear, request.id)
        try:
            with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as said:
                process = self._start(folder, output, said)
                ended = self._wait(process, (output, said), stop, hear)
                _end(process)
                text = _read_end(output, MAX_BYTES)
                words = _read_end(said, _MAX_WORDS) or text
        finally:
            self._arrivals.end(request.id)

        if ended is None and not text.strip():
            ended = "the program printed nothing"
        if ended is None:
            return checked(Reply(request.id, text, self.model))

        return self._refuse(request, ended + _quote(words))

    def _start(
        self, folder: Path, output: IO[bytes], said: IO[bytes]
    ) -> subprocess.Popen[bytes]:
        """Start the program.

        Args:
            folder: of the request, where it works.
            output: where it prints to.
            said: what it says on standard error.
        """
        feeds = not any(_FILE in word for word in self._words)
        given = folder / "prompt.md" if feeds else Path(os.devnull)
        with given.open("rb") as prompt:
            return subprocess.Popen(  # noqa: S603
                _fill(self._words, folder),
                cwd=folder,
                env=self._environment,
                stdin=prompt,
                stdout=output,
                stderr=said,
                start_new_session=True,
            )

    def _wait(
        self,
        process: subprocess.Popen[bytes],
        files: Sequence[IO[bytes]],
        stop: threading.Event,
        hear: Callable[[int], None],
    ) -> str | None:
        """Wait for the program's end, and say why it failed; None: it did not.

        Args:
            process: of the program.
            files: that it writes to, its output first.
            stop: is set when nobody waits any more.
            hear: is called with the number of bytes of output so far.
        """
        until = time.monotonic() + self._timeout_s
        while True:
            has_ended = process.poll() is not None
            sizes = [os.fstat(file.fileno()).st_size for file in files]
            if sizes[0]:
                hear(sizes[0])
            if max(sizes) > MAX_BYTES:
                return f"the program printed more than {MAX_BYTES // 1_000_000} MB"
            if has_ended:
                break
            if stop.is_set():
                return "interrupted"
            if time.monotonic() > until:
                return f"the program took longer than vlm.timeout_s={self._timeout_s:g}"
            stop.wait(0.05)

        if process.returncode < 0:
            return f"the program was ended by signal {-process.returncode}"
        if process.returncode:
            return f"the program ended with status {process.returncode}"

        return None

    def _fail(self, request: Request, error: Exception) -> Reply:
        """Make the reply of a program that could not be run."""
        return self._refuse(request, f"{type(error).__name__}: {error}")

    def _refuse(self, request: Request, error: str) -> Reply:
        """Make a reply without an answer; a resumed run asks again."""
        reply = Reply(request.id, "", self.model, clean(error, 1000), unanswered=True)
        return checked(reply)


def _keep_variables(named: Sequence[str]) -> dict[str, str]:
    """Return the environment for a program: without variables that hold keys, but for those that are named.

    Raises:
        UsageError: a variable that is named is not set.
    """
    missing = [name for name in named if name not in os.environ]
    if missing:
        raise UsageError(
            f"vlm.environment: {', '.join(missing)} is not set in the environment"
        )

    return {
        name: value
        for name, value in os.environ.items()
        if name in named or not (is_secret_name(name) or holds_secret(value))
    }


def _fill(words: Sequence[str], folder: Path) -> list[str]:
    """Put paths into the places for them in a program's arguments.

    Args:
        words: the program and its arguments.
        folder: of the request.
    """
    filled = []
    for word in words:
        if word == _PICTURES:
            filled += [str(picture) for picture in sorted(folder.glob("*.png"))]
        else:
            filled.append(word.replace(_FILE, str(folder / "prompt.md")))

    return filled


def _read_end(file: IO[bytes], most: int) -> str:
    """Read the last ``most`` bytes of a file."""
    file.seek(max(file.seek(0, os.SEEK_END) - most, 0))
    return file.read().decode("utf-8", "replace")


def _quote(words: str) -> str:
    """Return what a program said last, to follow the reason of its failure."""
    text = " ".join(scrub(words[-_MAX_WORDS:]).split())[-_SHOWN:]
    return f": {text}" if text else ""


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a program and all that it started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
        except (ProcessLookupError, PermissionError):
            break
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            continue

    process.wait()
