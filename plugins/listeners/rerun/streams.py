"""Writes the same data to several sinks, each of which may fail without harm to the others."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rerun as rr

from core.geometry import Array

APPLICATION = "vlmgineer"
_FLUSH_S = 10.0
_END_S = 5.0

Path = tuple[str, ...]


class Streams:
    """Streams of one recording, each to a sink of its own. One that fails is reported and dropped.

    There are two timelines, ``sim_time`` in seconds and ``generation``.

    Args:
        sinks: by their names in messages.
        name: of the recording.
        say: prints a message.
    """

    def __init__(self, sinks: Mapping[str, Any], name: str, say: Callable[[str], None]) -> None:
        self._say = say
        number = uuid.uuid4()
        self._streams = {where: rr.RecordingStream(APPLICATION, recording_id=number) for where in sinks}

        def start(where: str, stream: rr.RecordingStream) -> None:
            stream.set_log_time_enabled(False)
            stream.set_log_tick_enabled(False)
            stream.set_sinks(sinks[where])
            stream.send_recording_name(name)

        self._each(start)

    def __bool__(self) -> bool:
        """True while any stream is left."""
        return bool(self._streams)

    def at(self, sim_time: float, generation: int) -> None:
        """Set the time of what is logged next."""

        def move(_: str, stream: rr.RecordingStream) -> None:
            stream.set_time("sim_time", duration=sim_time)
            stream.set_time("generation", sequence=generation)

        self._each(move)

    def log(self, path: Path, *what: rr.AsComponents, static: bool = False) -> None:
        """Log at the time that is set, or with ``static`` for all times."""
        self._each(lambda _, stream: stream.log(list(path), *what, static=static, strict=True))

    def columns(self, path: Path, times: Array, generation: int, columns: Any) -> None:
        """Log many rows at once, at instants (T,) of ``sim_time``, all in one generation."""
        instants = rr.TimeColumn("sim_time", duration=times)
        same = rr.TimeColumn("generation", sequence=np.full(len(times), generation))
        entity = rr.new_entity_path(list(path))
        self._each(lambda _, stream: stream.send_columns(entity, [instants, same], columns, strict=True))

    def arrange(self, blueprint: rr.BlueprintLike) -> None:
        """Send the layout of the viewer."""
        self._each(lambda _, stream: stream.send_blueprint(blueprint))

    def flush(self) -> None:
        """Wait until all data have arrived."""
        self._each(lambda _, stream: stream.flush(timeout_sec=_FLUSH_S))

    def close(self) -> None:
        self.flush()
        for where in list(self._streams):
            if not self._ended(where):
                self._say(f"{where} does not take the last of the recording")

    def _each(self, function: Callable[[str, rr.RecordingStream], object]) -> None:
        for where, stream in list(self._streams.items()):
            try:
                function(where, stream)
            except RuntimeError as error:  # what Rerun raises when a disk or a viewer fails
                self._say(f"nothing more goes to {where}: {' '.join(str(error).split())}")
                self._ended(where)

    def _ended(self, where: str) -> bool:
        """End a stream; True if it ended in time. A viewer that hangs must not hold up the process at its exit."""
        ending = threading.Thread(target=self._streams.pop(where).disconnect, daemon=True)
        ending.start()
        ending.join(_END_S)
        if ending.is_alive():
            rr.unregister_shutdown()
        return not ending.is_alive()
