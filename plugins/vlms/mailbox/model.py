"""A person in the model's place, or a model behind a chat window: requests become folders, replies are put there."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
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
LARGEST = 20_000_000  # bytes of a reply

_HELP = (
    f"Mend the file or put another one in its place: it is read again when it changes. To leave this request without "
    f"an answer, put a file named {SKIP} here.\n"
)


class Mailbox(VLM):
    """Writes each request into a folder of its own, and waits until a reply is put there.

    A folder holds ``prompt.md``, the pictures that it names, and ``schema.json``. The reply is ``reply.json``, or
    ``reply.md`` with the JSON somewhere in it. One in which nothing can be tried is asked for again, for the reasons in
    ``problem.md``; of others ``problem.md`` lists what will be rejected. Replies that are there already, from a run
    that was interrupted, are taken at once.

    Args:
        folder: where the requests go; empty: ``mailbox`` in the run's folder.
        poll_s: seconds between two looks.
        quiet_s: a reply that is incomplete is judged when its file has not changed for so long.
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
        told = False
        while waiting:
            for letter in list(waiting):
                text = letter.look()
                if text is None:
                    continue
                waiting.remove(letter)
                error = "skipped by hand" if text == "" else None
                yield Reply(letter.request.id, text, self.model, error)
                if told:
                    _say(f"{letter.request.id} is answered; {len(waiting)} left")
            if waiting and not told:
                count = "1 request waits" if len(waiting) == 1 else f"{len(waiting)} requests wait"
                names = " or ".join(REPLIES)
                _say(f"{count} for an answer in {self._folder}; put {names} beside each prompt.md")
                told = True
            if waiting:
                time.sleep(self._poll_s)


class Letter:
    """A request in its folder."""

    def __init__(self, request: Request, folder: Path, quiet_s: float) -> None:
        self.request = request
        self.folder = folder
        self._quiet_s = quiet_s
        self._seen: dict[str, tuple[int, int]] = {}  # by file: its size and time when it was looked at last
        self._refused: dict[str, tuple[int, int]] = {}

    def post(self) -> None:
        """Write the request, unless it is there.

        Raises:
            UserError: the folder can't be written, or has a reply to another request.
        """
        text = "\n".join(as_markdown(message) for message in self.request.messages)
        prompt = self.folder / "prompt.md"
        try:
            if prompt.exists() and prompt.read_text(encoding="utf-8") == text:
                return
            if prompt.exists() and any((self.folder / name).exists() for name in (*REPLIES, SKIP)):
                raise UserError(
                    f"{self.folder} has a reply to another request than this run's; move it away, or choose another "
                    "vlm.folder"
                )
            self.folder.mkdir(parents=True, exist_ok=True)
            for message in self.request.messages:
                for part in message.parts:
                    if isinstance(part, Picture):
                        (self.folder / f"{part.name}.png").write_bytes(part.png)
            schema = json.dumps(self.request.schema, indent=1, ensure_ascii=False) + "\n"
            (self.folder / "schema.json").write_text(schema, encoding="utf-8")
            _write(prompt, text)  # last: where it is, the rest is
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"the mailbox {self.folder} can't be used: {error}") from error

    def look(self) -> str | None:
        """A reply in which something can be tried; empty: the person wants none; None: not yet."""
        if (self.folder / SKIP).exists():
            return ""
        for name in REPLIES:
            text = self._read(name)
            if text is not None:
                return text
        return None

    def _read(self, name: str) -> str | None:
        """The text of one file, if it is new, whole and of use."""
        file = self.folder / name
        mark = _mark(file)
        if mark is None or mark == self._refused.get(name):
            return None
        known, self._seen[name] = self._seen.get(name), mark
        quiet = time.time() - mark[1] / 1e9 >= self._quiet_s
        if known != mark and not quiet:  # perhaps still being written
            return None
        text, whole, usable = "", False, False
        problems: list[str] = []
        try:
            text = _load(file)
            whole, usable, problems = judge(self.request, text)
        except DesignError as error:
            problems = [str(error)]
        if not whole and not quiet:
            return None
        if usable:
            self._write_problems(f"{name} was taken; of it these will be rejected:", problems)
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
    """Whether a reply is whole, whether something in it can be tried, and what is wrong with it.

    Raises:
        DesignError: it can't be read at all.
    """
    brief = request.brief
    document = parse_reply(text)
    candidates = read_designs(
        document,
        brief.representation,
        SpawnRules(brief.task, brief.scene_seed),
        n_tool=brief.n_tool,
        n_action=brief.n_action,
    )
    strategies = document["strategies"] if isinstance(document, dict) else []
    whole = not any(isinstance(strategy, Unread) for strategy in strategies)
    problems = dict.fromkeys(f"strategy {c.strategy + 1}: {c.problem}" for c in candidates if c.problem is not None)
    return whole, any(c.problem is None for c in candidates), list(problems)


def _write(file: Path, text: str) -> None:
    """At once: nobody sees half of it."""
    partial = file.with_suffix(".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(file)


def _mark(file: Path) -> tuple[int, int] | None:
    """Size and time of change (nanoseconds) of a file; None: there is none, or nothing in it."""
    try:
        status = file.stat()
    except OSError:
        return None
    return (status.st_size, status.st_mtime_ns) if status.st_size else None


def _load(file: Path) -> str:
    """A file's text.

    Raises:
        DesignError: it can't be read.
    """
    try:
        size = file.stat().st_size
        if size > LARGEST:
            raise DesignError(f"it has {size} bytes; at most {LARGEST} are read")
        return file.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise DesignError(f"it can't be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DesignError(f"it is not UTF-8 text (byte {error.start}); save it as UTF-8") from error


def _say(what: str) -> None:
    sys.stderr.write(f"mailbox: {what}\n")
