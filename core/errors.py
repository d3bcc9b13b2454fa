"""Errors for a user's mistakes. The commands print them as one line, without a traceback."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Self, TypeVar

T = TypeVar("T")

RAISED = (Exception, SystemExit)
"""What to catch around the code of a plugin. `sys.exit` raises no Exception, and must not end a run without a word."""


@dataclass(frozen=True)
class Refusal:
    """Why something was refused, for a program: such as ``E_COUNT`` with ``{"count": 101, "most": 100}``.

    Attributes:
        code: that of a `Reason`.
        values: what the words name; the end of a name is the unit.
    """

    code: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.code} {json.dumps(self.dump()['values'])}"

    def dump(self) -> dict[str, Any]:
        """Write it as JSON has it: a number that is not finite is a text, and a text that is too long is cut."""
        values = {name: _as_json(value) for name, value in self.values.items()}
        return {"code": self.code, "values": values}


def _as_json(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str):
        return _cut(value)

    return value


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_TEXT else text[: _LONGEST_TEXT - 3] + "..."


_LONGEST_TEXT = 500
CATALOGUE: dict[str, str] = {}
"""The words of each code of a `Reason`."""


class Reason(Enum):
    """The catalogue of refusals: of each a code that stays, and words in which values stand by their names.

    The code of ``COUNT`` is ``E_COUNT``. For example::

        class ToolReason(Reason):
            COUNT = "the tool has {count} components; at most {most} are allowed"

        raise DesignError.because(ToolReason.COUNT, count=101, most=100)

    Raises:
        ValueError: another reason has this code.
    """

    def __init__(self, words: str) -> None:
        self.code = f"E_{self.name}"
        self.words = words
        if CATALOGUE.setdefault(self.code, words) != words:
            raise ValueError(f"two reasons have the code {self.code}")

    def refusal(self, **values: Any) -> Refusal:
        """Make the refusal for these values; numpy's numbers become Python's."""
        plain = {
            name: value.item() if hasattr(value, "item") else value
            for name, value in values.items()
        }
        return Refusal(self.code, plain)


class CodedError(Exception):
    """An error that may say its code; one that was raised ``from`` another has that one's."""

    _refusals: tuple[Refusal, ...] = ()

    @property
    def refusals(self) -> tuple[Refusal, ...]:
        """The codes and values of all that is wrong; empty: there is no code for it."""
        if not self._refusals and isinstance(self.__cause__, CodedError):
            return self.__cause__.refusals
        return self._refusals

    @classmethod
    def because(cls, reason: Reason, **values: Any) -> Self:
        """Build the error for a reason of the catalogue."""
        error = cls(reason.words.format(**values))
        return error.coded(reason.refusal(**values))

    def placed(self, words: str, /, **values: Any) -> Self:
        """Build the same error with words before its own, and values beside those of its reason."""
        error = type(self)(f"{words}{self}")
        return error.coded(
            *(
                Refusal(found.code, {**values, **found.values})
                for found in self.refusals
            )
        )

    def coded(self, *refusals: Refusal) -> Self:
        """Return the error, with these refusals as its own."""
        self._refusals = refusals
        return self


class UserError(CodedError):
    """A mistake of the user; the message says what is wrong, where, and what is possible.

    Attributes:
        problems: the errors of which it was made; empty: it is one.
    """

    problems: Sequence[UserError] = ()


class Problems(list[UserError]):
    """What is wrong, collected, so that a person reads all of it at once."""

    def attempt(self, make: Callable[..., T], *given: Any) -> T | None:
        """Call a function; None: it raised an error, which is noted."""
        try:
            return make(*given)
        except UserError as error:
            self.append(error)
            return None

    def report(self) -> None:
        """Raise one error for all that was noted, of the first one's type."""
        if self:
            whole = type(self[0])("; and ".join(map(str, self)))
            whole.problems = [
                problem for error in self for problem in error.problems or [error]
            ]
            raise whole.coded(*(found for error in self for found in error.refusals))


class NoPicture(UserError):
    """No picture can be drawn; the message says why, and what to do."""


class UsageError(UserError):
    """A command, a setting or a name that does not exist or can't be read."""


class LimitReached(UserError):
    """A spending limit is reached: no further request is sent, and the run ends with its best so far.

    Args:
        limit: which, in words.
        left: what is left undone.
    """

    def __init__(self, limit: str, left: str = "") -> None:
        super().__init__(f"{limit}; {left}" if left else limit)
        self.limit = limit


class NoAnswer(UserError):
    """No request of a generation was answered; they are sent again when the run goes on."""


class SharedByThreads(UserError):
    """Two threads of a process play at once; the message says what to do."""


class SettingReason(Reason):
    """What a setting breaks."""

    UNKNOWN = "no {kind} {name!r}; possible: {possible}"
    NOT_POSITIVE = "{name} must be greater than 0, got {given}"


class Fault(Exception):
    """The machine failed, not a design: no room on a disk, no memory, a worker that was killed."""


def fault(error: BaseException | None) -> str | None:
    """Describe the fault of the machine behind an error, in one line; None: there is none.

    Neither an OSError nor a lack of memory nor a missing module says anything about a design.
    """
    cause = error
    while cause is not None:
        no_thread = isinstance(cause, RuntimeError) and "new thread" in str(cause)
        if no_thread or isinstance(cause, Fault | OSError | MemoryError | ImportError):
            text = str(error)
            if cause is error and not isinstance(error, Fault | UserError):
                text = in_line(cause)
            return " ".join(text.split()).removesuffix(":")

        cause = cause.__cause__

    return None


def in_line(error: BaseException) -> str:
    """Describe an error in one line: its type, and what it says, if it can say it."""
    try:
        text = str(error)
    except Exception:  # of a plugin's class
        text = "it can't be printed"
    return " ".join(f"{type(error).__name__}: {text}".split())


def check_positive(where: str, **numbers: float | None) -> None:
    """Refuse numbers that are not finite and greater than 0; None is no number.

    Raises:
        UsageError: the message names the number.
    """
    for name, number in numbers.items():
        if number is not None and not (math.isfinite(number) and number > 0):
            raise UsageError.because(
                SettingReason.NOT_POSITIVE, name=where + name, given=number
            )


class WrongPart(CodedError, ValueError):
    """One of the parts of a whole can't be, such as a joint of a scene.

    Args:
        message: says why.
        part: which.
    """

    def __init__(self, message: str, part: object = None) -> None:
        super().__init__(message)
        self.part = part


def refuse(where: str, problems: Mapping[str, object], part: object = None) -> None:
    """Raise a ValueError for the first of some problems that is there.

    Args:
        where: what has them, such as ``joint 'lid': ``.
        problems: by their messages, whether each is there.
        part: the same as a value, for who catches it.

    Raises:
        WrongPart: one is there.
    """
    for problem, found in problems.items():
        if found:
            raise WrongPart(f"{where}{problem}", part)


def unknown(what: str, name: str, where: str, known: Iterable[str]) -> KeyError:
    """Build the error of a look-up by a name that is not there, ``where`` it is looked up; it lists the others."""
    listed = ", ".join(known) or "none"
    return KeyError(f"no {what} {name!r} {where}; there are: {listed}")


def choices(
    kind: str, wrong: str, possible: Iterable[str], where: str = ""
) -> UsageError:
    """Build the error for the unknown name ``wrong``: it lists the possible names, and suggests the closest."""
    known = sorted(possible)
    names = {name.lower(): name for name in reversed(known)}
    hint = "".join(
        f" (did you mean {names[close]!r}?)"
        for close in difflib.get_close_matches(wrong.lower(), names, n=1)
    )
    place = f" in {where}" if where else ""
    listed = ", ".join(known) or "none"
    refusal = SettingReason.UNKNOWN.refusal(kind=kind, name=wrong, possible=known)
    message = f"no {kind} {_cut(wrong)!r}{place}{hint}; possible: {listed}"
    return UsageError(message).coded(refusal)
