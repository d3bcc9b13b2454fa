"""A fuzzer of providers' answers: ``python -m tests.fuzz.answers -max_total_time=600 [-seed=1]``.

Random and mutated answers of each protocol go through a server on the loopback interface to the real model. Each must
give a reply that can be stored and printed, without the key, or an error in one line. It prints the number of answers
and each finding, with what repeats it.
"""

from __future__ import annotations

import copy
import gzip
import json
import logging
import os
import random
import sqlite3
import sys
import time
import zlib
from typing import Any

from tests.plugins.vlms.asking import KEYS, PROTOCOLS, VARIABLES, model_at
from tests.plugins.vlms.servers import Act, Call, Reset, Say, Send, document, request, serving

SLOWEST_S = 20.0
ALL_KEYS = " ".join(KEYS.values())
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 2**31, 2**53, 2**63, 2**64, -(2**63), 10**400, 0.5, -0.0, 1e308, float("nan")),
    *(float("inf"), "", "7", "NaN", "\ud83d", "\0", "\x1b[2J", "\u202e", ALL_KEYS, "x" * 100_000, "stop", "length"),
    *([], {}, [[]], [{}], [None], {"": None}, [1] * 5000, [{}] * 5000, {str(k): k for k in range(5000)}),
]
NAMES = ["choices", "usage", "model", "id", "error", "content", "text", "message", "tool_calls", "reasoning_content"]
STATUSES = [200] * 12 + [201, 204, 206, 300, 301, 307, 308, 400, 401, 403, 404, 413, 422, 429, 500, 502, 503, 529]
HEADERS = [("Location", "http://127.0.0.1:9/"), ("Retry-After", "0"), ("Content-Encoding", "gzip"), ("x", ALL_KEYS)]
HEADERS += [("Content-Encoding", "br"), ("Transfer-Encoding", "chunked"), ("Set-Cookie", "a=b"), ("Retry-After", "nan")]


def places(node: Any) -> list[tuple[Any, Any]]:
    """All containers with their keys, below ``node``."""
    keys = list(node) if isinstance(node, dict) else list(range(len(node))) if isinstance(node, list) else []
    return [(node, key) for key in keys] + [place for key in keys for place in places(node[key])]


def mutate(rng: random.Random, whole: Any) -> Any:
    """Change a document in one to four places."""
    for _ in range(rng.randint(1, 4)):
        at = places(whole)
        if not at:
            return whole
        node, key = rng.choice(at)
        what = rng.randrange(6)
        if what == 0:
            del node[key]
        elif what == 1:
            node[key] = copy.deepcopy(rng.choice(at)[0])
        elif what == 2 and isinstance(node, dict):
            node[rng.choice(NAMES)] = copy.deepcopy(rng.choice(VALUES))
        elif what == 3 and isinstance(node, list) and len(node) < 1000:
            node *= rng.choice([0, 2, 1000])
        else:
            node[key] = copy.deepcopy(rng.choice(VALUES))
        if len(at) > 20_000:
            return whole
    return whole


def answer(rng: random.Random, call: Call) -> Act:
    if rng.random() < 0.02:
        return Reset()
    said = rng.choice(["{}", '{"strategies": []}', ALL_KEYS, "half \ud83d", ""])
    whole = mutate(rng, document(Say(said, rng.choice([None, "length", "SAFETY", "\ud83d"])), call))
    body = json.dumps(whole).encode()
    kind = rng.randrange(10)
    if kind == 0 and body:  # bytes that are changed
        changed = bytearray(body)
        for _ in range(rng.randint(1, 20)):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
        body = bytes(changed)
    elif kind == 1:
        body = body[: rng.randrange(len(body) + 1)]
    elif kind == 2:
        body = rng.choice([b"", b"null", b"[" * 100_000, b'{"a":' * 100_000, rng.randbytes(1000), b"data: {}\n\n" * 9])
    headers = [rng.choice(HEADERS)] if rng.random() < 0.2 else []
    if rng.random() < 0.1:
        packer, name = rng.choice([(gzip.compress, "gzip"), (zlib.compress, "deflate")])
        body, headers = packer(body), [("Content-Encoding", name)]
    return Send(body, rng.choice(STATUSES), tuple(headers), rng.choice(["application/json", "text/html", "x"]))


def problem(reply: Any, seconds: float) -> str | None:
    """What is wrong with a reply; None: nothing."""
    lines = (reply.model, reply.error or "")
    wrong = {
        "slow": seconds > SLOWEST_S,
        "unprintable": not all(line.isprintable() for line in lines),
        "too long": any(len(line) > 2000 for line in lines),
        "a key": any(key in f"{reply.text}{lines}" for key in KEYS.values()),
        "a traceback": "Traceback" in lines[1],
        "no text and no error": not reply.text.strip() and not reply.error,
    }
    try:
        json.dumps(vars(reply), allow_nan=False).encode()
        reply.text.encode()
        sqlite3.connect(":memory:").execute("SELECT " + ",".join("?" * len(vars(reply))), list(vars(reply).values()))
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return next((name for name, is_so in wrong.items() if is_so), None)


def main() -> None:
    given = dict(word.lstrip("-").split("=", 1) for word in sys.argv[1:])
    first, end = int(given.get("seed", 0)), time.monotonic() + float(given.get("max_total_time", 60))
    os.environ.update({VARIABLES[protocol]: key for protocol, key in KEYS.items()})
    logging.disable(logging.CRITICAL)
    acts: list[Act] = []
    count = findings = 0
    with serving(lambda call: acts[-1]) as server:
        models = {protocol: model_at(server, protocol, retries=0, timeout_s=60.0) for protocol in PROTOCOLS}
        for model in models.values():  # LiteLLM imports parts of itself at a first call
            acts.append(Say())
            list(model.complete([request(0)]))
        while time.monotonic() < end:
            seed = first + count
            rng = random.Random(seed)
            protocol = rng.choice(list(PROTOCOLS))
            acts[:] = [answer(rng, Call("", {}, {"model": "m"}, protocol, "", [], [], 0.0))]
            begun = time.monotonic()
            try:
                (reply,) = models[protocol].complete([request(0)])
                found = problem(reply, time.monotonic() - begun)
            except Exception as error:
                found = f"raised {type(error).__name__}: {error}"
            server.calls.clear()
            count += 1
            if found:
                findings += 1
                print(f"-seed={seed} ({protocol}): {found[:300]}: {str(acts[0])[:300]}", flush=True)
            if "max_total_time" not in given and "seed" in given:
                break
    print(f"{count} answers, {findings} findings")
    sys.exit(findings > 0)


if __name__ == "__main__":
    main()
