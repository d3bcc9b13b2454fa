"""The mailbox: writes requests to folders, and reads the replies that a person puts there."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from core.design import DesignError
from core.designs.composer import as_markdown
from core.designs.reading import list_designs
from core.designs.replies import parse_reply
from core.errors import UserError, check_positive
from core.events import Generation, Run
from core.hooks import Names, hookimpl
from core.interfaces import VLM, Evaluation, Reply, Request
from core.plugins import installed
from core.search.answers import read_candidates
from core.support.cli import say
from core.support.files import FileMark, file_mark, read_text
from core.support.text import number
from plugins.vlms.context.feedback import describe
from plugins.vlms.prompt_files import NOW, write_file, write_letter
from plugins.vlms.second_look import list_faults

REPLIES = ("reply.json", "reply.md")
RESULTS = "results.md"
SKIP = "skip"
ACCEPT = "accept"
MAX_BYTES = 20_000_000  # of a reply
CHECKS = (
    3  # a reply is read when its file is the same at this many: it is written whole
)

_RESULTS_HEAD = (
    "What became of each design (generation, agent, design, plan) and its reward:\n"
)
_HELP = (
    f"Mend the file or replace it: it is read again when it changes. To skip this request, put a file named {SKIP} "
    "here.\n"
)
_ACCEPT_HELP = (
    f"Mend them in the file: it is read again when it changes. To have it taken as it is, put a file named {ACCEPT} "
    "here.\n"
)


_ANSWER = (
    f"Write the answer to the file `{REPLIES[0]}` beside this one. `schema.json` has its JSON schema, and `problem.md` "
    "appears if anything is wrong with it.\n"
)
_CRITIQUE = f"Write the answer to the file `{REPLIES[1]}` beside this one.\n"
_KNOWN = (
    "Rules and task, with their pictures, are those of `../{name}/prompt.md`. Below are the sections that are new, or "
    "read otherwise.\n\n"
)
_SECTION = re.compile(r"^(?=# [A-Z])", re.MULTILINE)


class Mailbox(VLM):
    """Writes each request into a folder of its own, and waits for a reply in that folder.

    A folder holds ``prompt.md``, the pictures that it names, and ``schema.json``. What a later generation's prompt has
    in common with a first one stands in the first one's file alone. The reply is ``reply.json``, or ``reply.md`` with
    the JSON somewhere in it. While designs of a reply can't be tried, ``problem.md`` lists all faults
    of all of them, and the reply may be amended; a file named ``accept`` has it taken as it is. Replies that are
    already there, from an interrupted run, are used at once. After a generation ``results.md`` says what became of each
    design.

    Args:
        folder: folder of the requests; empty: ``mailbox`` in the run's folder.
        poll_s: seconds between two checks for replies.
        amend: wait for amendments; else a reply with any sound design is taken as it is.
    """

    model = "mailbox (answered by hand)"
    takes_schema = True

    def __init__(
        self,
        folder: Annotated[str, Names("folder")] = "",
        poll_s: float = 0.5,
        amend: bool = True,
    ) -> None:
        check_positive("vlm.", poll_s=poll_s)
        self._folder = Path(folder or "mailbox")
        self._own = bool(folder)
        self._poll_s = poll_s
        self._amend = amend
        self._run: Run | None = None

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._run = run
        if not self._own:
            self._folder = run.folder / "mailbox"

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        """Write to each request's folder what became of its designs, unless prompts keep silent on it too."""
        assert self._run is not None
        settings = self._run.config["prompt"]
        if settings["feedback"] == "paper":
            return

        level = installed().factory("level", settings["context"])()
        sight = level.sight(self._run.task, self._run.seed)
        by_agent: dict[int, list[Evaluation]] = {}
        for evaluation in generation.evaluations:
            by_agent.setdefault(evaluation.candidate.agent, []).append(evaluation)

        for agent, evaluations in by_agent.items():
            file = self._folder / f"g{generation.index}-a{agent}" / RESULTS
            if file.parent.is_dir():
                lines = [
                    f"- {e.candidate.id}: {describe(e, sight)}" for e in evaluations
                ]
                write_file(file, "\n".join([_RESULTS_HEAD, *lines, ""]).encode())
                best = number(max(e.reward for e in evaluations), 3)
                _say(f"the best of {file.parent.name} earned {best}; {file} says more")

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`.

        Raises:
            UserError: the folder can't be written, or has a reply to another request.
        """
        waiting = [
            Letter(request, self._folder / request.id, self._amend)
            for request in requests
        ]
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
                requests_wait = f"{len(waiting)} requests wait"
                if len(waiting) == 1:
                    requests_wait = "1 request waits"
                names = " or ".join(REPLIES)
                _say(
                    f"{requests_wait} for an answer in {self._folder}; put {names} beside each prompt.md"
                )
                announced = True

            if waiting:
                time.sleep(self._poll_s)


@dataclass(eq=False)
class Letter:
    """One request and its folder. By file, it keeps what `file_mark` gave last, and at how many checks.

    Others may write to the folder: nothing is written or read through a link.

    Attributes:
        request: that waits for a reply.
        folder: of this request alone.
        amend: faulty designs may be amended before the reply is taken.
    """

    request: Request
    folder: Path
    amend: bool = True
    _amendable: str | None = None
    _checks: dict[str, tuple[FileMark | None, int]] = field(default_factory=dict)

    def post(self) -> None:
        """Write the request, if it is not there yet.

        Raises:
            UserError: the folder can't be written, or has a reply to another request.
        """
        text = self._write_prompt()
        prompt = self.folder / "prompt.md"

        try:
            if _holds(prompt, text):
                return

            answers = [self.folder / name for name in (*REPLIES, SKIP)]
            if prompt.exists() and any(answer.exists() for answer in answers):
                raise UserError(
                    f"{self.folder} has a reply to a different request; move it away, or change vlm.folder"
                )

            write_letter(self.folder, self.request, text)
        except OSError as error:
            raise UserError(
                f"the mailbox {self.folder} can't be used: {error}"
            ) from error

    def _write_prompt(self) -> str:
        """Write the request as a text that says where to answer.

        A prompt of a later generation leaves out the sections that stand in that of a first request.
        """
        text = "\n".join(as_markdown(message) for message in self.request.messages)
        if not self.request.asks_designs:
            return text + _CRITIQUE

        shortest = text
        if self.request.brief.generation:
            for file in sorted(self.folder.parent.glob("g0-*/prompt.md")):
                news = _leave_out_known(text, file)
                if len(news) < len(shortest):
                    shortest = _KNOWN.format(name=file.parent.name) + news

        return shortest + _ANSWER

    def look(self) -> str | None:
        """Look for a usable reply; empty: the person skipped the request; None: there is no reply yet."""
        if (self.folder / SKIP).exists():
            return ""
        if self._amendable is not None and (self.folder / ACCEPT).exists():
            return self._amendable

        for name in REPLIES:
            text = self._read(name)
            if text is not None:
                return text

        return None

    def _read(self, name: str) -> str | None:
        """Read one file, if it rests and is usable. A reply that was there before the request rests."""
        mark = file_mark(self.folder / name)
        last, checks = self._checks.get(name, (mark, CHECKS - 1))
        checks = checks + 1 if mark == last else 1
        self._checks[name] = mark, checks

        if mark is None or mark[0] == 0 or checks != CHECKS:
            return None

        usable = False
        self._amendable = None
        try:
            text = _load(self.folder / name)
            usable, problems = judge(self.request, text)
        except DesignError as error:
            problems = [str(error)]

        if usable and problems and self.amend:
            self._amendable = text
            heading = f"{name} can be used, but for these of its designs:"
            self._write_problems(heading, problems, _ACCEPT_HELP)
            _say(
                f"{self.request.id}: some designs of {name} can't be tried; {self.folder / 'problem.md'} says why"
            )
            return None

        if usable:
            orphans = find_orphans(self.request, text)
            if orphans:
                _say(f"{self.request.id}: {orphans}")
            self._write_problems(
                f"{name} is accepted; these of its designs will be rejected:", problems
            )
            return text

        self._write_problems(f"{name} can't be used:", problems, _HELP)
        _say(
            f"{self.request.id}: {name} can't be used; {self.folder / 'problem.md'} says why"
        )

        return None

    def _write_problems(
        self,
        heading: str,
        problems: Sequence[str],
        ending: str = "",
    ) -> None:
        """Write ``problem.md``, or remove that of an earlier reply.

        Args:
            heading: what became of the reply.
            problems: a line each; none: the file of an earlier reply goes.
            ending: what to do.
        """
        file = self.folder / "problem.md"
        if not problems:
            file.unlink(missing_ok=True)
            return

        listed = "".join(f"- {problem}\n" for problem in problems)
        write_file(file, f"{heading}\n\n{listed}\n{ending}".encode())


def judge(request: Request, text: str) -> tuple[bool, list[str]]:
    """Check a reply: is any design usable, and what is wrong with it?

    Args:
        request: of designs, or of a critique.
        text: the reply.

    Returns:
        Whether it can be used, and a line for each problem.

    Raises:
        DesignError: it can't be read at all.
    """
    if not request.asks_designs:  # any text is one
        return (True, []) if text.strip() else (False, ["it is empty"])

    designs = list_designs(parse_reply(text))
    candidates = read_candidates(request.brief, designs, starts=True)
    is_usable = any(candidate.problem is None for candidate in candidates)
    return is_usable, list_faults(candidates)


def find_orphans(request: Request, text: str) -> str:
    """Say which designs of a reply name no elite as a parent, where the schema asks for one; empty: none."""
    elites = [elite.candidate.id for elite in request.brief.elites]
    if not elites or not request.asks_designs:
        return ""

    orphans = []
    for place, design in enumerate(list_designs(parse_reply(text)), 1):
        named = design.get("parents") if isinstance(design, dict) else None
        if not isinstance(named, list) or not {*elites}.intersection(map(str, named)):
            orphans.append(str(place))

    if not orphans:
        return ""
    return (
        f"no `parents` in design {', '.join(orphans)}, which counts as new; name those of {', '.join(elites)} that it "
        "comes from"
    )


def _load(file: Path) -> str:
    """Read a file's text, but not through a link, which may lead anywhere.

    Raises:
        DesignError: it can't be read.
    """
    if file.parent.is_symlink() or file.is_symlink():
        raise DesignError("it is a link; put the file itself there")

    try:
        return read_text(file, most=MAX_BYTES)
    except UserError as error:
        raise DesignError(str(error)) from error


def _holds(file: Path, text: str) -> bool:
    """Report whether a file has this text."""
    try:
        return _load(file) == text
    except DesignError:  # missing, or something that `_write` replaces
        return False


def _leave_out_known(text: str, file: Path) -> str:
    """Leave out the sections of a prompt that stand in the prompt of ``file``, but what is wanted."""
    try:
        first = _load(file)
    except DesignError:
        return text

    known = _SECTION.split(first)
    sections = _SECTION.split(text)
    return "".join(
        section
        for section in sections
        if section.startswith(NOW) or section not in known
    )


def _say(text: str) -> None:
    say(f"mailbox: {text}", file=sys.stderr)
