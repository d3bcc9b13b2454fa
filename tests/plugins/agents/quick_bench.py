"""A bench without a run, for tests of the protocol: it notes what it does, and is slow where it is told to be.

``python -m tests.plugins.agents.quick_bench FILE [PORT]``. ``watch`` of the candidate ``slow`` takes two seconds, and
``try_design`` and ``finish`` go on until there is a file ``FILE.done``.
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

    def do(self, name, arguments):
        with self.file.open("a") as notes:
            notes.write(f"{name} {arguments.get('candidate', '')}\n")
        if name in ("try_design", "finish"):
            raise Later(None if name == "finish" else "{}")
        if arguments.get("candidate") == "slow":
            time.sleep(2)
        return [Text(name + "." * arguments.get("count", 0))]


def main(file, port=None):
    streams = _take_streams() if port is None else None
    bench = open_bench(_interrupt)
    bench.desk = Desk(Path(file))
    _start_server(bench, port and int(port), streams)
    done = Path(f"{file}.done")
    try:
        while True:
            bench.wait()
            while not done.exists():
                time.sleep(0.05)
            bench.answer(lambda: [Text("what came of it")])
    except KeyboardInterrupt:
        print("the agent has left", file=sys.stderr)


main(*sys.argv[1:])
