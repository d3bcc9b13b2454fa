"""Change a scene file that a person wrote: one entry, and all else stays as it is."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import yaml

_AFTER = re.compile(r"(?:\n[ \t]*(?:#.*)?)*\Z")  # empty lines and comments


def set_variation(text: str, name: str, block: str) -> str:
    """Write a variation into a scene file, in the place of one of that name.

    Args:
        text: of the file, which is sound.
        name: of the variation.
        block: its lines, of which the first has its name.
    """
    block = textwrap.dedent(block).strip()
    root: Any = yaml.compose(text, yaml.SafeLoader)
    entries = {key.value: value for key, value in root.value}
    if "variations" not in entries:
        return f"{text.rstrip()}\nvariations:\n{textwrap.indent(block, '  ')}\n"

    node = entries["variations"]
    start = node.start_mark.index
    if isinstance(node, yaml.MappingNode) and not node.flow_style:
        depth = " " * node.start_mark.column
        block = textwrap.indent(block, depth).lstrip()
        for key, value in node.value:
            if key.value == name:
                start = key.start_mark.index
                rest = text[value.end_mark.index :]
                after = _AFTER.search(text[start : value.end_mark.index])
                return f"{text[:start]}{block}{after[0] if after else ''}{rest}"

        return f"{text[:start]}{block}\n{depth}{text[start:]}"

    # It stands in braces, or is empty: each variation gets lines of its own.
    lines = [block]
    for key, value in node.value or ():
        if key.value != name:
            lines.append(text[key.start_mark.index : value.end_mark.index])

    comment, _, rest = text[node.end_mark.index :].partition("\n")
    whole = textwrap.indent("\n".join(lines), "  ")
    return f"{text[:start].rstrip()}{comment}\n{whole}\n{rest}"
