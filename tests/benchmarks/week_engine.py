"""The engines of `tests.benchmarks.week`, and its model: a plugin."""

from __future__ import annotations

import os
import time
from typing import Any

from core.hooks import Factories, hookimpl
from core.interfaces import Outcome
from tests.support.toys import Notes, ToyEngine, ToyModel

LEAK_BYTES = 20_000_000
HANGS_AT = 40
"""Which rollout of a worker never ends, where the number of its process is odd; others run out of memory."""

HOUR_S = 3600.0


class Hard(ToyEngine):
    """Keeps memory, and hangs now and then; both are noted."""

    kept: tuple[bytearray, ...] = ()

    def __init__(self, notes: str) -> None:
        self.notes = Notes(notes)

    def _outcome(self, task: Any, job: Any) -> Outcome:
        try:
            Hard.kept += (bytearray(LEAK_BYTES),)
        except MemoryError:
            self.notes.add(f"full after {len(Hard.kept)}")
            raise
        if os.getpid() % 2 and len(Hard.kept) == HANGS_AT:
            self.notes.add(f"hung at {HANGS_AT}")
            time.sleep(HOUR_S)
        return super()._outcome(task, job)


@hookimpl
def simulators() -> Factories:
    return {"toy": ToyEngine, "hard": Hard}


@hookimpl
def vlms() -> Factories:
    return {"toy": ToyModel}
