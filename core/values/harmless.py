"""Say in the type of a setting that a stranger may choose it: what a stored configuration is taken at its word for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class IsHarmless:
    """Marks a setting whose texts name nothing outside of the program."""


@dataclass(frozen=True)
class Names:
    """Marks a setting that names something outside, and says what, as in ``Annotated[str, Names("file")]``."""

    what: str


@dataclass(frozen=True)
class PartsOf:
    """Marks a setting that names parts of a kind, as in ``Annotated[list[str | dict[str, Any]], PartsOf("sim")]``.

    Each is a name, or a mapping of a ``name`` and settings, which are judged by that part's own types.
    """

    kind: str


Harmless = Annotated[T, IsHarmless()]
"""The type of a setting that a run's folder may hand to a person who resumes the run, as in ``Harmless[str]``.

Numbers, truths and `Literal` need no such word. Any other text may be a program, an address or a file, and is taken
from a stored configuration only where the user types it again.
"""
