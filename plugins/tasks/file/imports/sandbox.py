"""Call a function with what is piped in, and write the bytes that it returns: a process, with a limit on memory.

Libraries that read files may take any time and memory, or crash, on one that was made to do so.
Covered by `tests/plugins/tasks/file/imports/test_mesh.py`.
"""

from __future__ import annotations

import contextlib
import importlib
import resource
import sys
from pathlib import Path

from core.errors import UserError
from plugins.tasks.file.imports.solids import REFUSED

MEMORY = 8_000_000_000  # bytes of addresses

if __name__ == "__main__":
    with contextlib.suppress(ValueError, OSError):  # a system that has no such limit, or a lower one
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    _module, _function, *_words, _out = sys.argv[1:]
    try:
        Path(_out).write_bytes(getattr(importlib.import_module(_module), _function)(sys.stdin.buffer.read(), *_words))
    except (UserError, MemoryError) as error:
        sys.exit(REFUSED + (" ".join(str(error).split()) or "needs too much memory; make it smaller"))
