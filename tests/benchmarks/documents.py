"""Read tools as models may write them: ``python -m tests.benchmarks.documents [count=2000] [kinds=boxes]``.

A third of the documents is sound, a third is broken in one to four places, and a third is as much work as the limits
allow. Each is read in a child process, by the representation and by the rules. Printed are the crashes, those that took
longer than ``limit_s``, and the slowest and the largest; ``only=K`` reads document K alone.
"""

from __future__ import annotations

import contextlib
import copy
import json
import math
import multiprocessing
import random
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from core.design import DesignError
from core.designs.rules import check_tool
from core.interfaces import ToolRepresentation
from plugins.tools.boxes import BoxTools
from plugins.tools.solids.representation import SolidTools
from plugins.tools.urdf.representation import UrdfTools
from tests.fuzz.answers import VALUES
from tests.panda import PANDA

MEMORY_MB = 1500  # of addresses, above those of a child that has read nothing
FRESH = 250  # documents after which a child is replaced, so that its peak of memory says something
KINDS: dict[str, Callable[[], ToolRepresentation]] = {
    "boxes": lambda: BoxTools(joints=True),
    "solids": lambda: SolidTools(joints=True),
    "urdf": lambda: UrdfTools(joints=True),
}


def pose(rng: random.Random, reach: float = 0.02) -> list[float]:
    turned = [rng.choice([0, 0, math.pi / 2, rng.uniform(-3.2, 3.2)]) for _ in range(3)]
    return [rng.uniform(-reach, reach) for _ in range(3)] + turned


def outline(rng: random.Random, points: int, low: float, high: float) -> list[list[float]]:
    """Make a star, which does not cross itself."""
    turns = sorted(rng.uniform(0, math.tau) for _ in range(points))
    return [[r * math.cos(t), r * math.sin(t)] for t in turns for r in [rng.uniform(low, high)]]


def comb(teeth: int, axis: int) -> dict[str, Any]:
    points = [[0.0, 0.0]]
    for k in range(teeth):
        points += [[0.01 * k, 0.2], [0.01 * k + 0.005, 0.2], [0.01 * k + 0.005, 0.01], [0.01 * k + 0.01, 0.01]]
    turn = ([0, 0, 0], [math.pi / 2, 0, 0], [0, math.pi / 2, 0])[axis]
    return {"extrude": [*points[1:], [0.01 * teeth, 0.0], [-0.001, 0.0]], "height": 0.3, "at": [0, 0, 0, *turn]}


def leaf(rng: random.Random, large: float = 0.08) -> dict[str, Any]:
    r = [rng.uniform(0.002, large) for _ in range(3)]
    made: list[dict[str, Any]] = [
        *({"box": r}, {"sphere": r[0]}, {"cylinder": r[:2]}, {"capsule": r[:2]}, {"cone": [r[0], r[1] - 0.002, r[2]]}),
        {"extrude": outline(rng, rng.randint(3, 48), 0.2 * large, large), "height": r[0]},
        {"revolve": [[abs(x) + 0.001, z] for x, z in outline(rng, 5, large / 2, large)], "angle": rng.uniform(0.1, 6)},
        {"revolve": [[0, 0], [r[0], 0], [r[0], r[1]], [r[0] - 0.001, r[1]], [r[0] - 0.001, 0.001], [0, 0.001]]},
        {"hull": [pose(rng, large)[:3] for _ in range(rng.randint(4, 128))]},
    ]
    return rng.choice(made) | ({"at": pose(rng)} if rng.random() < 0.7 else {})


def tree(rng: random.Random, depth: int, width: int, large: float = 0.08) -> dict[str, Any]:
    if depth == 0:
        return leaf(rng, large)
    name = rng.choice(["union", "union", "difference", "difference", "intersection"])
    children = [tree(rng, depth - rng.randint(1, depth), width, large) for _ in range(rng.randint(2, width))]
    return {name: children, "at": pose(rng)}


def bowl(rng: random.Random) -> dict[str, Any]:
    r = rng.uniform(0.01, 0.06)
    cut = {"box": [1, 1, 1], "at": [0, 0, 0.5 + rng.uniform(-0.3, 0.3) * r]}
    return {"difference": [{"sphere": r}, {"sphere": r - rng.uniform(0.0015, 0.006)}, cut]}


def heavy(rng: random.Random) -> dict[str, Any]:
    """Make a solid that is hard work."""
    teeth = [comb(rng.randint(4, 11), axis) for axis in rng.sample(range(3), rng.randint(2, 3))]
    holes = [{"cylinder": [0.005, 1], "at": [rng.uniform(-0.3, 0.3) for _ in "xy"] + [0]} for _ in range(38)]
    made: list[Any] = [
        {rng.choice(["union", "difference", "intersection"]): teeth},
        {"difference": [{"box": [0.6, 0.6, 0.01]}, *holes[: rng.randint(10, 38)]]},
        {"union": [{"sphere": rng.uniform(0.05, 1), "at": pose(rng, 0.5)} for _ in range(rng.randint(2, 39))]},
        {"difference": [{"sphere": 1.0}, *({"sphere": 0.6, "at": pose(rng, 0.9)} for _ in range(rng.randint(1, 38)))]},
        {"intersection": [{"sphere": 1.0, "at": pose(rng, 0.3)} for _ in range(rng.randint(2, 39))]},
        {"revolve": [[abs(x), z] for x, z in outline(rng, 48, 0.3, 1.0)]},
        {"difference": [leaf(rng, 1.0), tree(rng, 4, 4, 1.0)]},
        tree(rng, 7, 5),
    ]
    return dict(rng.choice(made))


def joint(rng: random.Random) -> dict[str, Any]:
    numbers = {name: rng.choice([0.0, rng.uniform(0, 0.02)]) for name in ("damping", "friction", "stiffness", "rest")}
    ends = {"lower": -rng.uniform(0.01, 0.4), "upper": rng.choice([0.0, rng.uniform(0, 0.4)])}
    return {"kind": rng.choice(["hinge", "slider"]), "axis": pose(rng)[:3], "at": pose(rng)[:3], **ends, **numbers}


def sound(rng: random.Random, kind: str) -> list[dict[str, Any]]:
    """Make a list of components that hang from each other."""
    items: list[dict[str, Any]] = []
    for k in range(rng.randint(1, 6)):
        item: dict[str, Any] = {
            "name": f"c{k}",
            "position": [0, 0, -0.02 * k - 0.02],
            "rpy": pose(rng)[3:],
            "mass": 0.01,
        }
        item |= {"parent": items[-1]["name"]} if items and rng.random() < 0.9 else {"color": "#aabbcc"}
        if kind == "boxes":
            (name, _), *_ = leaf(rng, 0.05).items()
            round_ones = {"cylinder": {"radius": 0.02, "length": 0.05}, "capsule": {"radius": 0.02, "length": 0.05}}
            shape = (
                {"shape": "box", "size": [0.02, 0.03, 0.05]} if name == "box" else {"shape": "sphere", "radius": 0.02}
            )
            item |= {"shape": name, **round_ones[name]} if name in round_ones else shape
        else:
            item["solid"] = json.dumps(rng.choice([leaf(rng), tree(rng, 2, 3), bowl(rng)]))
        items.append(item | ({"joint": joint(rng)} if rng.random() < 0.2 else {}))
    return items


def mutate(rng: random.Random, whole: Any) -> Any:
    """Change a document in one to four places."""
    for _ in range(rng.randint(1, 4)):
        node = whole
        while isinstance(node, dict | list) and node:
            key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
            if not isinstance(node[key], dict | list) or rng.random() < 0.25:
                break
            node = node[key]
        else:
            continue
        what = rng.randrange(5)
        if what == 0:
            del node[key]
        elif what == 1 and isinstance(node, list):
            node *= rng.choice([0, 2, 1000])
        elif what == 2:
            node[key] = copy.deepcopy(whole)
        elif what == 3 and isinstance(node[key], float):
            node[key] *= rng.choice([-1, 0, 1e-3, 1e3, 1e-9])
        else:
            node[key] = copy.deepcopy(rng.choice(VALUES))
    return whole


def document(kind: str, number: int, seed: int) -> Any:
    rng = random.Random(f"{kind} {number} {seed}")
    items: Any = sound(rng, "boxes" if kind == "urdf" else kind)
    if kind == "urdf":
        items = [item | {"shape": "box", "size": item.get("size", [0.02, 0.02, 0.02])} for item in items]
        items = [{key: item[key] for key in item.keys() - {"radius", "length"}} for item in items]
        items = KINDS["urdf"]().dump(KINDS["boxes"]().parse({"tool_components": items}, gripper=False))["tool_urdf"]
    what = number % 3
    if what == 1 and isinstance(items, str):
        at, end = sorted(rng.randrange(len(items)) for _ in range(2))
        items = rng.choice(
            [items[:at], items[:at] + items[end:], items[:end] + items[at:] * 3, items.replace("0", "9e9")]
        )
    elif what == 1:
        if kind == "solids" and rng.random() < 0.7:  # inside the trees
            for item in items:
                inner = mutate(rng, json.loads(item["solid"]))
                with contextlib.suppress(MemoryError):  # shared values may be too much as text
                    item["solid"] = rng.choice([inner, json.dumps(inner)])
        else:
            items = mutate(rng, items)
    elif what == 2 and kind == "solids":
        count = rng.choice([1, 1, 2, 5, 30])
        solids = [rng.choice([heavy, bowl])(rng) for _ in range(count)]
        items = [{"name": f"c{k}", "solid": solid, "position": [0, 0, -0.1]} for k, solid in enumerate(solids)]
    elif what == 2 and not isinstance(items, str):
        items = [{**items[0], "name": f"c{k}", "parent": f"c{k + 1}"} for k in range(rng.randint(2, 2000))]
        items[-1]["parent"] = "tool_mount"
    return {next(iter(KINDS[kind]().schema())): items}


def read(kind: str, data: Any) -> str:
    representation = KINDS[kind]()
    representation.robot = PANDA
    try:
        tool = representation.parse(data, gripper=False)
    except DesignError:
        return "refused"
    try:
        check_tool(tool, PANDA)
    except DesignError:
        return "against the rules"
    return "accepted"


def stable(kind: str, data: Any) -> bool:
    """Tell whether a tool that is written and read again is written the same."""
    representation = KINDS[kind]()
    representation.robot = PANDA
    written = representation.dump(representation.parse(data, gripper=False))
    return representation.dump(representation.parse(written, gripper=False)) == written


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def child(kind: str, seed: int, orders: Connection) -> None:
    for name in KINDS:  # imports what is imported late
        read(name, document(name, 0, 0))
    addresses = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (addresses + MEMORY_MB * 2**20, resource.RLIM_INFINITY))
    orders.send(peak_mb())
    while True:
        data = document(kind, orders.recv(), seed)
        orders.send(None)
        began, cpu = time.monotonic(), time.process_time()
        try:
            found = read(kind, data)
        except BaseException as error:
            found = f"CRASH {type(error).__name__}: {error}"[:300]
        spent = time.monotonic() - began, time.process_time() - cpu, peak_mb()
        # URDF is written with twelve digits, of which the last ones change.
        if kind != "urdf" and found in ("accepted", "against the rules") and not stable(kind, data):
            found = "CRASH unstable when written again"
        orders.send((found, *spent))


def run(kind: str, count: int, seed: int, limit_s: float, only: int | None) -> int:
    """Read documents of one kind; print what was found, and return the number of failures."""
    context = multiprocessing.get_context("fork")
    process, ours, base = None, None, 0.0
    found: Counter[str] = Counter()
    slowest, busiest, largest = (0.0, -1), (0.0, -1), (0.0, -1)
    failures = 0
    for done, number in enumerate(range(count) if only is None else [only]):
        if process is None or done % FRESH == 0:
            if process is not None:
                process.kill()
            ours, theirs = context.Pipe()
            process = context.Process(target=child, args=(kind, seed, theirs), daemon=True)
            process.start()
            theirs.close()
            base = ours.recv()
        assert ours is not None
        ours.send(number)
        try:
            ours.recv()  # it has made the document
            outcome, wall, cpu, peak = ours.recv() if ours.poll(5 * limit_s) else ("HANG", 5 * limit_s, 0.0, 0.0)
        except EOFError:
            outcome, wall, cpu, peak = "CRASH the process died", 0.0, 0.0, 0.0
        failed = outcome.startswith(("CRASH", "HANG")) or cpu > limit_s
        if outcome.startswith(("HANG", "CRASH the process")):
            process.kill()
            process = None
        failures += failed
        found[outcome.split(" ")[0] if outcome.startswith(("CRASH", "HANG")) else outcome] += 1
        if failed:
            print(f"{kind} only={number} seed={seed}: {outcome} after {cpu:.2f} s of processor", flush=True)
        slowest, busiest = max(slowest, (wall, number)), max(busiest, (cpu, number))
        largest = max(largest, (peak - base, number))
    if process is not None:
        process.kill()
    counts = ", ".join(f"{number} {outcome}" for outcome, number in sorted(found.items()))
    print(
        f"{kind}: {counts}; slowest {busiest[0]:.2f} s of processor (document {busiest[1]}), {slowest[0]:.2f} s by the "
        f"clock; largest {largest[0]:.0f} MB above the start (document {largest[1]})",
        flush=True,
    )
    return failures


def main() -> None:
    given = dict(word.split("=", 1) for word in sys.argv[1:])
    kinds = given.get("kinds", ",".join(KINDS)).split(",")
    count, only = int(given.get("count", 2000)), given.get("only")
    arguments = (int(given.get("seed", 0)), float(given.get("limit_s", 2.0)), None if only is None else int(only))
    shares = [count // len(kinds) + (k < count % len(kinds)) for k in range(len(kinds))]
    failures = sum(run(kind, share, *arguments) for kind, share in zip(kinds, shares, strict=True))
    sys.exit(failures > 0)


if __name__ == "__main__":
    main()
