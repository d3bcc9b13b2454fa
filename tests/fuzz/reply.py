"""A coverage-guided fuzzer for what reads replies: ``python -m tests.fuzz.reply CORPUS_FOLDER -max_total_time=600``.

It needs Atheris (``pip install atheris``); flags are libFuzzer's. Every reply must give candidates or a `DesignError`
in time, and a candidate without a problem keeps the rules. An input that breaks this is written to ``crash-...``; the
same command with that file repeats it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(
    include=["core.designs.reading", "core.designs.rules", "core.design", "plugins.tools.urdf", "json"]
):
    import json.decoder
    import json.scanner

    from core.design import Candidate, DesignError
    from core.designs.reading import parse_reply, read_designs
    from plugins.tools.urdf.representation import UrdfTools
from tests.hostile import REPLIES, TOOLS, reply_of, sound, spawn_rules
from tests.panda import on_panda
from tests.soundness import check_candidate

json.scanner.make_scanner = json.scanner.py_make_scanner  # in Python, so that its branches are traced
PLAN = [[0.5, 0.0, 0.4, 0.0, 0.0, 0.0]]


def one(data: bytes) -> None:
    """Read a reply, or a tool's text where the first byte is even."""
    try:
        text = data[1:].decode("utf-8", "surrogatepass")
    except UnicodeDecodeError:
        text = data[1:].decode("latin-1")
    if data[:1] and data[0] % 2 == 0:
        document: object = {"strategies": [{"gripper": data[0] % 4 == 0, "tool_urdf": text, "action_sets": [PLAN]}]}
        candidates = read_designs(document, on_panda(UrdfTools()), spawn_rules())
    else:
        candidates = reading(text)
    for candidate in candidates:
        check_candidate(candidate)


def reading(text: str) -> list[Candidate]:
    try:
        return read_designs(parse_reply(text), on_panda(UrdfTools()), spawn_rules(), most=(10, 10))
    except DesignError:
        return []


def main() -> None:
    folders = [Path(word) for word in sys.argv[1:] if not word.startswith("-")]
    if folders and not folders[0].is_file():
        folders[0].mkdir(parents=True, exist_ok=True)
        seeds = [
            b"\x01" + text.encode("utf-8", "surrogatepass")
            for text in (*(value for value in REPLIES.values() if isinstance(value, str)), reply_of(sound()))
        ]
        seeds += [
            b"\x02" + text.encode("utf-8", "surrogatepass")
            for text in (*(value for value in TOOLS.values() if isinstance(value, str)), sound()["tool_urdf"])
        ]
        for number, seed in enumerate(seeds):
            if len(seed) < 20_000:
                (folders[0] / f"seed-{number}").write_bytes(seed)
    spawn_rules()
    atheris.Setup([*sys.argv, "-timeout=20", "-rss_limit_mb=2048", "-max_len=20000"], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
