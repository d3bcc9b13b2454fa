"""Read a person's idea of a tool and its motion, for ``prompt=human``."""

from __future__ import annotations

import re
from pathlib import Path

from core.errors import UsageError, UserError
from core.support.files import read_text

MAX_IDEA = 50_000  # bytes


def read_idea(file: str | None, *, wanted: bool) -> str | None:
    """Read a person's text, without its HTML comments. ``wanted``: the prompt quotes it.

    Raises:
        UserError: it is wanted and missing, or given and not wanted, or not readable text.
    """
    if not file and wanted:
        raise UsageError(
            "prompt.file is empty; give the text file with your idea, such as prompt.file=my_idea.md"
        )

    if not file:
        return None
    if not wanted:
        raise UsageError(
            f"prompt.file={file} is not used by this prompt; add prompt=human"
        )

    text = read_text(Path(file), f"prompt.file={file}", MAX_IDEA)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL).strip()
    if not text:
        raise UserError(
            f"prompt.file={file} is empty; describe the tool and its motion"
        )

    return text
