"""A bench without a run, for tests of the protocol: it notes what it does, and is slow where it is told to be.

``python -m tests.plugins.agents.quick_bench FILE``. ``watch`` of the candidate ``slow``, ``try_design`` and ``finish``
go on until there is a file ``FILE.done``.
"""

import sys
import time
from pathlib import Path

from core.interfaces import Text
from plugins.agents.bench import Later, open_bench
from plugins.agents.mcp_command import _interrupt, _start_server, _take_streams


class Desk:
    """Notes calls, and answers with the tool's name."""

    def __init__(self, file):
        self.file = file

    def hold(self):
        """Wait until there is the file that ends it."""
        while not Path(f"{self.file}.done").exists():
            time.sleep(0.02)

    def do(self, name, arguments):
        with self.file.open("a") as notes:
            notes.write(f"{name} {arguments.get('candidate', '')}\n")
        if name in ("try_design", "finish"):
            raise Later(None if name == "finish" else "{}")
        if arguments.get("candidate") == "slow":
            self.hold()
        return [Text(name + "." * arguments.get("count", 0))]


def main(file):
    streams = _take_streams()
    bench = open_bench(_interrupt)
    bench.desk = Desk(Path(file))
    _start_server(bench, None, streams)
    try:
        while True:
            bench.wait()
            bench.desk.hold()
            bench.answer(lambda: [Text("what came of it")])
    except KeyboardInterrupt:
        print("the agent has left", file=sys.stderr)


main(*sys.argv[1:])
