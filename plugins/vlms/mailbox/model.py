"""The mailbox: writes requests to folders, and reads the replies that a person puts there."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from core.design import DesignError
from core.designs.composer import as_markdown
from core.designs.reading import Unread, parse_reply, read_designs
from core.designs.rules import SpawnRules
from core.errors import UserError, check_positive
from core.events import Run
from core.hooks import hookimpl
from core.interfaces import VLM, Picture, Reply, Request

REPLIES = ("reply.json", "reply.md")
SKIP = "skip"
MAX_BYTES = 20_000_000  # of a reply

_HELP = (
    f"Mend the file or replace it: it is read again when it changes. To skip this request, put a file named {SKIP} "
    "here.\n"
)


class Mailbox(VLM):
    """Writes each request into a folder of its own, and waits for a reply in that folder.

    A folder holds ``prompt.md``, the pictures that it names, and ``schema.json``. The reply is ``reply.json``, or
    ``reply.md`` with the JSON somewhere in it. A reply without a usable design is refused, and ``problem.md`` gives the
    reasons. For other replies ``problem.md`` lists the designs that will be rejected. Replies that are already there,
    from an interrupted run, are used at once.

    Args:
        folder: folder of the requests; empty: ``mailbox`` in the run's folder.
        poll_s: seconds between two checks for replies.
        quiet_s: an incomplete reply is checked when its file has not changed for this many seconds.
    """

    model = "mailbox (answered by hand)"

    def __init__(self, folder: str = "", poll_s: float = 0.5, quiet_s: float = 5.0) -> None:
        check_positive("vlm.", poll_s=poll_s, quiet_s=quiet_s)
        self._folder = Path(folder or "mailbox")
        self._own = bool(folder)
        self._poll_s, self._quiet_s = poll_s, quiet_s

    @hookimpl
    def run_started(self, run: Run) -> None:
        if not self._own:
            self._folder = run.folder / "mailbox"

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`.

        Raises:
            UserError: the folder can't be written, or has a reply to another request.
        """
        waiting = [Letter(request, self._folder / request.id, self._quiet_s) for request in requests]
        for letter in waiting:
            letter.post()
        announced = False
        while waiting:
            for letter in list(waiting):
                text = letter.look()
                if text is None:
                    continue
                waiting.remove(letter)
                error = "skipped by hand" if text == "" else None
                yield Reply(letter.request.id, text, self.model, error)
                if announced:
                    _say(f"{letter.request.id} is answered; {len(waiting)} left")
            if waiting and not announced:
                count = "1 request waits" if len(waiting) == 1 else f"{len(waiting)} requests wait"
                names = " or ".join(REPLIES)
                _say(f"{count} for an answer in {self._folder}; put {names} beside each prompt.md")
                announced = True
            if waiting:
                time.sleep(self._poll_s)


@dataclass(eq=False)
class Letter:
    """One request and its folder. By file, it keeps size and time of change at the last check and at a refusal."""

    request: Request
    folder: Path
    quiet_s: float
    _last: dict[str, tuple[int, int]] = field(default_factory=dict)
    _refused: dict[str, tuple[int, int]] = field(default_factory=dict)

    def post(self) -> None:
        """Write the request, if it is not there yet.

        Raises:
            UserError: the folder can't be written, or has a reply to another request.
        """
        text = "\n".join(as_markdown(message) for message in self.request.messages)
        prompt = self.folder / "prompt.md"
        try:
            if prompt.exists() and prompt.read_text(encoding="utf-8") == text:
                return
            if prompt.exists() and any((self.folder / name).exists() for name in (*REPLIES, SKIP)):
                raise UserError(f"{self.folder} has a reply to a different request; move it away, or change vlm.folder")
            self.folder.mkdir(parents=True, exist_ok=True)
            for message in self.request.messages:
                for part in message.parts:
                    if isinstance(part, Picture):
                        (self.folder / f"{part.name}.png").write_bytes(part.png)
            schema = json.dumps(self.request.schema, indent=1, ensure_ascii=False) + "\n"
            (self.folder / "schema.json").write_text(schema, encoding="utf-8")
            _write(prompt, text)  # last, so that the other files are there when it is
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"the mailbox {self.folder} can't be used: {error}") from error

    def look(self) -> str | None:
        """A usable reply; empty: the person skipped the request; None: there is no reply yet."""
        if (self.folder / SKIP).exists():
            return ""
        return next((text for name in REPLIES if (text := self._read(name)) is not None), None)

    def _read(self, name: str) -> str | None:
        """The text of one file, if it is new, complete and usable."""
        file = self.folder / name
        mark = _mark(file)
        if mark is None or mark == self._refused.get(name):
            return None
        known, self._last[name] = self._last.get(name), mark
        quiet = time.time() - mark[1] / 1e9 >= self.quiet_s
        if known != mark and not quiet:  # perhaps still being written
            return None
        text, complete, usable = "", False, False
        try:
            text = _load(file)
            complete, usable, problems = judge(self.request, text)
        except DesignError as error:
            problems = [str(error)]
        if not complete and not quiet:
            return None
        if usable:
            self._write_problems(f"{name} is accepted; these of its designs will be rejected:", problems)
            return text
        self._refused[name] = mark
        self._write_problems(f"{name} can't be used:", problems, _HELP)
        _say(f"{self.request.id}: {name} can't be used; {self.folder / 'problem.md'} says why")
        return None

    def _write_problems(self, heading: str, problems: Sequence[str], ending: str = "") -> None:
        file = self.folder / "problem.md"
        if not problems:
            file.unlink(missing_ok=True)
            return
        listed = "".join(f"- {problem}\n" for problem in problems)
        _write(file, f"{heading}\n\n{listed}\n{ending}")


def judge(request: Request, text: str) -> tuple[bool, bool, list[str]]:
    """Check a reply: is it complete, is any design usable, and what is wrong with it?

    Raises:
        DesignError: it can't be read at all.
    """
    brief = request.brief
    document = parse_reply(text)
    spawn = SpawnRules(brief.task, brief.scene_seed)
    candidates = read_designs(document, brief.representation, spawn, n_tool=brief.n_tool, n_action=brief.n_action)
    strategies = document["strategies"] if isinstance(document, dict) else []
    complete = not any(isinstance(strategy, Unread) for strategy in strategies)
    problems = dict.fromkeys(f"strategy {c.strategy + 1}: {c.problem}" for c in candidates if c.problem is not None)
    return complete, any(c.problem is None for c in candidates), list(problems)


def _write(file: Path, text: str) -> None:
    """Write atomically, so that no reader gets half of it."""
    partial = file.with_suffix(".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(file)


def _mark(file: Path) -> tuple[int, int] | None:
    """Size and time of change (nanoseconds) of a file; None: it is missing or empty."""
    try:
        status = file.stat()
    except OSError:
        return None
    return (status.st_size, status.st_mtime_ns) if status.st_size else None


def _load(file: Path) -> str:
    """Read a file's text.

    Raises:
        DesignError: it can't be read.
    """
    try:
        size = file.stat().st_size
        if size > MAX_BYTES:
            raise DesignError(f"it has {size} bytes; at most {MAX_BYTES} are allowed")
        return file.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise DesignError(f"it can't be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DesignError(f"it is not UTF-8 text (byte {error.start}); save it as UTF-8") from error


def _say(text: str) -> None:
    sys.stderr.write(f"mailbox: {text}\n")
