"""Do the tests see faults? ``python -m tests.benchmarks.mutants [count=N] [seed=N] [room=core/store,...]``.

Faults are put in at random places of core and plugins, one at a time, in a clone of what is committed. The tests that
mirror the file run first, then those of its room that import it, then the room's others, then all that import it,
until one fails. A test that hangs has failed. What survives needs a test, or a reason why nobody could notice.
"""

from __future__ import annotations

import ast
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rich.table import Table

from core.support.cli import arguments, command
from tests.benchmarks import measuring

USAGE = "usage: python -m tests.benchmarks.mutants [count=N] [seed=N] [room=FOLDER,...] [most_s=S]"
ROOT = Path(__file__).parents[2]
HANGS = "a test hangs"
HANGS_S = 300
"""How long a test may take that does not hang, in seconds."""
LEFT_OUT = ("plugins/new/templates/", "plugins/simulators/mujoco/batched/")
OPPOSITE = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


@dataclass
class Settings:
    """``room``: folders of core and plugins; ``most_s``: how long the tests of one fault may take, in seconds."""

    count: int = 20
    seed: int = 0
    room: list[str] = field(default_factory=lambda: ["core", "plugins"])
    most_s: float = 1200.0


@dataclass(frozen=True)
class Mutant:
    """A fault: in ``file``, ``new`` stands in place of the ``old`` bytes from ``start``."""

    file: str
    line: int
    kind: str
    start: int
    old: str
    new: str

    def write(self, clone: Path) -> None:
        """Put the fault into a clone."""
        source = (ROOT / self.file).read_bytes()
        rest = source[self.start + len(self.old.encode()) :]
        (clone / self.file).write_bytes(source[: self.start] + self.new.encode() + rest)

    def __str__(self) -> str:
        old = " ".join(self.old.split())
        new = " ".join(self.new.split())
        return f"{self.file}:{self.line}: {old}  ->  {new}"


def main() -> None:
    """Try as many faults as are asked for, and print the rate by room."""
    settings = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    drawn = draw(settings.room, settings.count, random.Random(settings.seed))
    seen: dict[str, list[bool | None]] = defaultdict(list)
    survivors = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        clone = Path(folder) / "clone"
        subprocess.run(["git", "clone", "-q", "--shared", ROOT, clone], check=True)
        for mutant in drawn:
            mutant.write(clone)
            killer = try_tests(clone, mutant.file, settings.most_s)
            (clone / mutant.file).write_bytes((ROOT / mutant.file).read_bytes())

            home = test_room(mutant.file)
            own = killer is not None and killer.startswith((home, HANGS))
            seen[room_of(mutant.file)].append(own if killer else None)
            print(f"{mutant}\n    {killer or 'SURVIVED'}", flush=True)
            if killer is None:
                survivors.append(mutant)

    measuring.console.print(tabulate(seen))
    for survivor in survivors:
        print(f"survived: {survivor}")


def draw(rooms: list[str], count: int, chance: random.Random) -> list[Mutant]:
    """Draw faults: first the kind, then a place of that kind."""
    places: dict[str, list[Mutant]] = defaultdict(list)
    for room in rooms:
        for path in sorted((ROOT / room).rglob("*.py")):
            file = path.relative_to(ROOT).as_posix()
            if not file.startswith(LEFT_OUT):
                for mutant in find_mutants(file):
                    places[mutant.kind].append(mutant)

    drawn: dict[Mutant, None] = {}
    kinds = sorted(places)
    while len(drawn) < min(count, sum(map(len, places.values()))):
        drawn[chance.choice(places[chance.choice(kinds)])] = None
    return [*drawn]


def find_mutants(file: str) -> Iterator[Mutant]:
    """Find each place of a file where a fault can be put."""
    source = (ROOT / file).read_bytes()
    lines = source.splitlines(keepends=True)
    tree = ast.parse(source)
    hidden = set(_find_hidden(tree))
    for node in ast.walk(tree):
        if node in hidden:
            continue

        for kind, place, new in _mutate(node):
            start = sum(map(len, lines[: place.lineno - 1])) + place.col_offset
            old = ast.get_source_segment(source.decode(), place) or ""
            if source[start:].startswith(old.encode()) and _is_same(old, place):
                yield Mutant(file, place.lineno, kind, start, old, new)


def _find_hidden(tree: ast.AST) -> Iterator[ast.AST]:
    """Find the nodes of annotations: they do nothing while the program runs."""
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            if isinstance(annotation := getattr(node, name, None), ast.AST):
                yield from ast.walk(annotation)


def _is_same(text: str, node: ast.expr) -> bool:
    """Check a node's place: Python 3.11 misplaces some within f-strings."""
    try:
        return ast.dump(ast.parse(text, mode="eval").body) == ast.dump(node)
    except SyntaxError:
        return False


def _mutate(node: ast.AST) -> Iterator[tuple[str, ast.expr, str]]:
    """Yield the kind of a fault, the node that it replaces, and the new text."""
    match node:
        case ast.BinOp(op=ast.Add() | ast.Sub()) if not _is_text(node):
            new = ast.BinOp(node.left, OPPOSITE[type(node.op)](), node.right)
            yield "sign", node, ast.unparse(new)
        case ast.BoolOp():
            yield (
                "and-or",
                node,
                ast.unparse(ast.BoolOp(OPPOSITE[type(node.op)](), node.values)),
            )
        case ast.Compare(ops=[operator]):
            new = ast.Compare(node.left, [OPPOSITE[type(operator)]()], node.comparators)
            yield "compare", node, ast.unparse(new)
        case ast.If():
            yield "check", node.test, "False"
        case ast.Call(args=[first, second, *rest]):
            starred = any(isinstance(value, ast.Starred) for value in node.args)
            if not starred and ast.dump(first) != ast.dump(second):
                new = ast.Call(node.func, [second, first, *rest], node.keywords)
                yield "swap", node, ast.unparse(new)
        case ast.Constant(value=int() | float() as value):
            if not isinstance(value, bool):
                yield "number", node, repr(2 * value if value else 1)


def _is_text(node: ast.BinOp) -> bool:
    return any(
        isinstance(side, ast.JoinedStr)
        or (isinstance(side, ast.Constant) and isinstance(side.value, str | bytes))
        for side in (node.left, node.right)
    )


def find_tests(clone: Path, file: str) -> list[str]:
    """List the test modules that could see a fault of a file, the likeliest first."""
    path = Path(file)
    module = path.with_suffix("").as_posix().replace("/", ".")
    module = module.removesuffix(".__init__")
    package = module.rpartition(".")[0]
    pattern = re.compile(rf"\b{re.escape(module)}\b|from {re.escape(package)} import")

    tests = [*sorted((clone / "tests").rglob("test_*.py"))]
    relative = [test.relative_to(clone).as_posix() for test in tests]
    mirrors = [name for name in relative if Path(name).stem == f"test_{path.stem}"]
    mirrors = [name for name in mirrors if name.startswith(test_room(file))]
    imported = [
        name
        for name, test in zip(relative, tests, strict=True)
        if pattern.search(test.read_text())
    ]
    room = [name for name in relative if name.startswith(test_room(file) + "/")]
    near = [name for name in room if name in imported]
    return [*dict.fromkeys([*mirrors, *near, *room, *imported])]


def test_room(file: str) -> str:
    """Return the folder of tests of a file's room: the nearest one that there is."""
    folder = Path("tests", file).parent
    while not any((ROOT / folder).glob("test_*.py")) and folder != Path("tests"):
        folder = folder.parent
    return folder.as_posix()


def room_of(file: str) -> str:
    """Return the room of a file: two folders, or one with the flat files of core."""
    parts = Path(file).parts
    return "/".join(parts[:2]) if len(parts) > 2 else parts[0]


def try_tests(clone: Path, file: str, most_s: float) -> str | None:
    """Run the tests until one fails or hangs, and return its name; None: none fails while there is time."""
    environment = dict(os.environ, PYTHONPATH=str(clone))
    tests = find_tests(clone, file)
    hangs = [f"-ofaulthandler_timeout={HANGS_S}", "-ofaulthandler_exit_on_timeout=true"]
    words = ["-m", "pytest", "-qx", "-n0", "-pno:cacheprovider", *hangs, *tests]
    with subprocess.Popen(
        [sys.executable, *words],
        cwd=clone,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            output, _ = process.communicate(timeout=most_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return None

    if process.returncode == 0:
        return None

    if "Timeout (" in output:
        return HANGS

    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", output, re.MULTILINE)
    return failed[1] if failed else f"exit status {process.returncode}"


def tabulate(seen: dict[str, list[bool | None]]) -> Table:
    """Make the table: faults by room, seen by its own tests, by others, and by none."""
    table = Table("room", "faults", "own tests", "others", "survived", "rate")
    everything = [found for room in seen.values() for found in room]
    for room, found in [*sorted(seen.items()), ("all", everything)]:
        counts = [found.count(value) for value in (True, False, None)]
        rate = f"{1 - counts[2] / len(found):.0%}"
        table.add_row(room, str(len(found)), *map(str, counts), rate)
    return table


if __name__ == "__main__":
    command(lambda _: main())
