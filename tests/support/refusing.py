"""Rows of refusals: what is changed at a door, and by which code and values it is refused.

A file of ``tests/refusals`` has the name of its door, and the text that is sound there, or the file that holds it. A
row is what is replaced (``~``: the file's ``what``), by what, the code, some of its values, and where there is a
limit, what stands on its other side and is sound. What is replaced, and by what, may be lists. Where a refusal has no
code, the row has null, and of its values the ``words``.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from core.config.compose import load
from core.design import DesignError
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.designs.start import SpawnRules
from core.errors import CodedError, Refusal, UserError
from core.plugins import installed
from plugins.tasks.file.task import FileTask
from tests.support.panda import on_panda
from tests.support.scenes import CubeOnTable
from tests.support.text import replaced

ROWS = Path(__file__).parents[1] / "refusals"


@dataclass(frozen=True)
class Row:
    """A change, and how it is refused.

    Attributes:
        door: the name of its file.
        text: what is sound.
        old: what is replaced in it.
        new: by what.
        code: the code of the refusal.
        values: some of its values.
        sound: what in place of ``old`` is sound, too; None: nothing is said of it.
    """

    door: str
    text: str
    old: list[str]
    new: list[str]
    code: str
    values: dict[str, Any] = field(default_factory=dict)
    sound: list[str] | None = None

    def __str__(self) -> str:
        return f"{self.door}-{self.code}"


def list_rows() -> Iterator[Row]:
    """Read the rows of all doors."""
    for file in sorted(ROWS.glob("*.yaml")):
        written = yaml.safe_load(file.read_text("utf-8"))
        text = written.get("text") or (ROWS.parent / written["file"]).read_text()
        for old, new, code, *others in written["rows"]:
            values, sound = [*others, None, None][:2]
            yield Row(
                file.stem,
                text,
                spell(old or written["what"]),
                spell(new),
                code or "",
                values or {},
                None if sound is None else spell(sound),
            )


def spell(written: Any) -> list[str]:
    """Write out texts, and what is repeated: ``{times: 3, of: "x#", around: "[@]"}`` is ``[x0, x1, x2]``."""
    if isinstance(written, list):
        return [text for part in written for text in spell(part)]
    if isinstance(written, str):
        return [written]

    texts = (written["of"].replace("#", str(k)) for k in range(written["times"]))
    joined = written.get("join", ", ").join(texts)
    return [written["around"].replace("@", joined)]


def find_refusals(row: Row, new: list[str], folder: Path) -> list[Refusal]:
    """Return how a door refuses the text with a change; none: it is sound."""
    text = replaced(row.text, *zip(row.old, new, strict=True))
    return DOORS[row.door](text, folder)


def fits(found: Refusal, code: str, values: dict[str, Any]) -> bool:
    """Check a refusal's code, and the values that a row has: numbers to a thousandth, texts from and up to ``...``."""
    return found.code == code and all(
        _is_same(found.values.get(name), value) for name, value in values.items()
    )


def _is_same(found: object, wanted: object) -> bool:
    is_number = isinstance(wanted, int | float) and not isinstance(wanted, bool)
    if is_number and isinstance(found, float):
        return math.isclose(found, wanted, rel_tol=1e-3)
    if isinstance(wanted, str) and wanted.startswith("..."):
        return wanted.strip(".") in str(found)
    if isinstance(wanted, str) and wanted.endswith("..."):
        return str(found).startswith(wanted.removesuffix("..."))
    return found == wanted


# --- the doors --------------------------------------------------------------------------------------------------


def read_design(text: str, folder: Path, **settings: Any) -> list[Refusal]:
    """Read a reply with a design for a cube on a table, and let it be planned."""
    representation = installed().create("tool", settings.pop("tool"), **settings)
    task = on_panda(CubeOnTable())
    try:
        candidates = read_designs(
            parse_reply(text), on_panda(representation), task, start=SpawnRules(task)
        )
    except DesignError as error:
        return [*list_refusals(error.refusals, str(error))]
    return [
        found
        for candidate in candidates
        for found in list_refusals(candidate.refusals, candidate.problem)
    ]


def list_refusals(refusals: Sequence[Refusal], words: str | None) -> Iterator[Refusal]:
    """Yield refusals; one without a code has the words."""
    yield from refusals
    if words:
        assert words.isprintable()
        assert len(words) < 1000
        if not refusals:
            yield Refusal("", {"words": words})


def read_scene(text: str, folder: Path) -> list[Refusal]:
    """Read a scene file."""
    file = folder / "my_scene.yaml"
    file.write_text(text, encoding="utf-8")
    try:
        FileTask(str(file))
    except UserError as error:
        line = str(error)
        assert len(line.splitlines()) == 1
        assert line.startswith(str(file))
        return [*error.refusals]
    return []


def read_settings(text: str, folder: Path) -> list[Refusal]:
    """Read the words of a run."""
    try:
        load("config", text.split())
    except UserError as error:
        return [*error.refusals]
    return []


DOORS: dict[str, Callable[[str, Path], list[Refusal]]] = {
    "boxes": lambda text, folder: read_design(text, folder, tool="boxes", joints=True),
    "urdf": lambda text, folder: read_design(text, folder, tool="urdf", joints=True),
    "anchored": lambda text, folder: read_design(text, folder, tool="boxes"),
    "solids": lambda text, folder: read_design(text, folder, tool="solids"),
    "scene": read_scene,
    "settings": read_settings,
}


# --- in Python --------------------------------------------------------------------------------------------------


@contextmanager
def refused(code: str, **values: Any) -> Iterator[pytest.ExceptionInfo[CodedError]]:
    """Expect an error with a code and values, where no text at a door provokes it."""
    with pytest.raises(CodedError) as caught:
        yield caught
    found = caught.value.refusals
    assert any(fits(refusal, code, values) for refusal in found), found or caught.value
