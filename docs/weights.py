"""Write into ``CONTRIBUTING.md`` what each room weighs: ``python docs/weights.py``.

The size of code is counted in syntax nodes without docstrings, which neither long names nor more lines make larger.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "CONTRIBUTING.md"
BEGIN = "<!-- weights: python docs/weights.py -->\n"
END = "<!-- end of weights -->\n"


@dataclass
class Weight:
    """What the files of a room weigh: their number, their lines, their syntax nodes."""

    files: int = 0
    lines: int = 0
    nodes: int = 0

    def add(self, text: str) -> None:
        """Add a file."""
        self.files += 1
        self.lines += text.count("\n")
        self.nodes += count_nodes(ast.parse(text))


def count_nodes(tree: ast.AST) -> int:
    """Count the nodes of a tree that are neither a docstring nor the mark of a load or a store."""
    count = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.expr_context):
            continue
        count += 1
        for statement in statements(node):
            if is_docstring(statement):
                count -= 2  # the statement, and the text in it
    return count


def statements(node: ast.AST) -> list[ast.stmt]:
    """Return the body of a module, a class, a function or a branch; empty: it has none."""
    body = getattr(node, "body", None)
    return body if isinstance(body, list) else []


def is_docstring(statement: ast.stmt) -> bool:
    """Report whether a statement is a text alone."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def weigh(files: Iterable[Path]) -> Weight:
    """Weigh files."""
    weight = Weight()
    for file in files:
        weight.add(file.read_text("utf-8"))
    return weight


def rooms(folder: str) -> Iterator[tuple[str, list[Path]]]:
    """Yield the flat files of a folder, and each of its rooms with all files below it."""
    root = ROOT / folder
    yield f"`{folder}/*.py`", sorted(root.glob("*.py"))
    for room in sorted(root.iterdir()):
        files = sorted(room.rglob("*.py"))
        if files:
            yield f"`{folder}/{room.name}/`", files


def table() -> str:
    """Write the weights, as Markdown."""
    lines = ["| room | files | lines | nodes |", "|---|---|---|---|"]
    for folder in ("core", "plugins", "tasks"):
        for room, files in rooms(folder):
            lines.append(row(room, weigh(files)))
        lines.append(row(f"all of `{folder}/`", weigh((ROOT / folder).rglob("*.py"))))
    return "\n".join(lines) + "\n"


def row(name: str, weight: Weight) -> str:
    """Write one row."""
    return f"| {name} | {weight.files} | {weight.lines:,} | {weight.nodes:,} |"


def main() -> None:
    before, _, others = PAGE.read_text("utf-8").partition(BEGIN)
    _, _, after = others.partition(END)
    page = f"{before}{BEGIN}\n{table()}\n{END}{after}"
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
