"""A fuzzer of URDF files: ``python -m tests.fuzz.urdfs [-runs=10000] [-seed=1]``.

It changes a few files at random, their trees and sometimes their bytes, and reads each as a scene's import
(`plugins.tasks.file.imports.read_bodies`) or as an arm of one's own (`plugins.robots.own_arm.read_robot`). What is read
must make a scene of finite numbers, which MuJoCo plays in one case of ten, or a robot whose arm can be computed; else
there is an error of one line. All else is a finding, as is a file that takes more than 20 s. Each is printed with its
seed; ``-seed=N -runs=1`` repeats it.
"""

from __future__ import annotations

import copy
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import trimesh

from core.errors import UserError
from core.interfaces import Rollout
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.robot.solids import robot_solids
from plugins.conformance.worlds import BARE, Bodies, still
from plugins.robots import hulls
from plugins.robots.own_arm import read_robot
from plugins.simulators.inertia import inertia_of
from plugins.tasks.file.imports import read_bodies, solids
from tests.plugins.tasks.file.imports.conftest import called
from tests.support import outside_arm
from tests.support.cabinets import cabinet, joint, link, mesh

SLOWEST_S = 20.0
VALUES = [
    *(
        "",
        " ",
        "0",
        "-0",
        "1",
        "-1",
        "1e-300",
        "5e-324",
        "1e300",
        "1e308",
        "inf",
        "-inf",
        "nan",
        "0x1",
        "1_000",
        "1,5",
    ),
    *(
        "0 0 0",
        "1 0 0",
        "0 0 1e-200",
        "nan 0 0",
        "1e200 1e200 1e200",
        "1 1",
        "1 1 1 1",
        "9" * 5000,
        "1 " * 5000,
    ),
    *(
        "fixed",
        "continuous",
        "revolute",
        "prismatic",
        "planar",
        "floating",
        "link0",
        "case",
        "drawer",
        "world",
    ),
    *(
        "panda",
        "../box.stl",
        "/etc/passwd",
        "file:///dev/zero",
        "package://../box.stl",
        "box.obj",
        "http://x.org/a.stl",
    ),
    *(
        "a\nb",
        "\u202e",
        "x" * 300,
        "${oc.env:HOME}",
        "<b>",
        "tool",
        "table",
        "$(find x)",
        "\u0663",
        "3\u00a04",
    ),
]
TAGS = [
    "link",
    "joint",
    "visual",
    "collision",
    "inertial",
    "geometry",
    "box",
    "mesh",
    "axis",
    "limit",
    "mimic",
]
ATTRIBUTES = [
    "name",
    "type",
    "link",
    "xyz",
    "rpy",
    "value",
    "lower",
    "upper",
    "size",
    "radius",
    "length",
    "filename",
]


def files(folder: Path) -> list[bytes]:
    """Write meshes into a folder, and return URDF texts that can be read there; the last is an arm's."""
    for name in ("box.stl", "box.obj"):
        trimesh.creation.box((0.1, 0.1, 0.1)).export(folder / name)
    chain = link("link0") + "".join(
        link(f"link{k}")
        + joint(f"j{k}", kind, f"link{k - 1}", f"link{k}", '<axis xyz="0 1 0"/>')
        for k, kind in enumerate(("continuous", "fixed", "floating"), 1)
    )
    ball = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
    round_ = '<collision><geometry><cylinder radius="0.1" length="0.2"/></geometry></collision>'
    texts = [
        cabinet(
            more='<dynamics damping="3" friction="0.5"/><mimic joint="glue" multiplier="2"/>'
        ),
        chain,
        link("crate", mesh("box.obj") + mesh("box.stl", "visual") + ball)
        + link("door", round_)
        + joint("hinge", "continuous", "crate", "door"),
    ]
    scenes = [f'<robot name="model">{text}</robot>'.encode() for text in texts]
    return [*scenes, outside_arm.write_arm(folder).read_bytes()]


def changed(rng: random.Random, data: bytes) -> bytes:
    """Change a text's tree in one to four places, and in one case of seven its bytes."""
    root = ElementTree.fromstring(data)
    for _ in range(rng.randint(1, 4)):
        change(rng, root)
    made = bytearray(ElementTree.tostring(root))
    if rng.random() < 1 / 7:
        for _ in range(rng.randint(1, 8)):
            made[rng.randrange(len(made))] = rng.randrange(256)
        if rng.random() < 0.3:
            del made[rng.randrange(len(made)) :]
    return bytes(made)


def change(rng: random.Random, root: Element) -> None:
    """Change one element of a tree: its attributes, its name, its place, or how often it is there."""
    every = [root, *root.iter()]
    parent, other = (
        rng.choice([one for one in every if len(one)] or [root]),
        rng.choice(every),
    )
    child, kind = rng.choice([*parent] or [root]), rng.random()
    if kind < 0.5:
        attributes = [*child.attrib] or ATTRIBUTES
        value = rng.choice([rng.choice(VALUES), *other.attrib.values()])
        child.set(rng.choice([rng.choice(attributes), rng.choice(ATTRIBUTES)]), value)
    elif kind < 0.6 and child.attrib:
        del child.attrib[rng.choice([*child.attrib])]
    elif kind < 0.7 and child is not root:
        parent.remove(child)
    elif kind < 0.8:
        parent.extend([copy.deepcopy(child)] * rng.choice([1, 2, 600]))
    elif kind < 0.9:
        other.append(copy.deepcopy(child))
    else:
        child.tag = rng.choice(TAGS)


def read_scene(rng: random.Random, file: Path) -> None:
    """Read a file as an import, check that its numbers are finite, and play it sometimes."""
    made = read_bodies(file, fixed=rng.random() < 0.7, prefix=rng.choice(["", "a_"]))
    task = Bodies(*made.bodies, joints=made.joints)
    state, inertias = (
        task.scene(0).state(),
        [inertia_of(body) for body in made.bodies if not body.fixed],
    )
    numbers = [
        *state.arrays,
        *([inertia.mass, *inertia.moments] for inertia in inertias),
    ]
    assert all(np.isfinite(part).all() for part in numbers), "a number is not finite"
    assert all("\n" not in note for note in made.notes), made.notes
    if rng.random() < 0.1:
        installed().create("sim", "mujoco").rollout(
            task, [Rollout(BARE, still(), hold_s=0.05)]
        )


def read_arm(file: Path) -> None:
    """Read a file as an arm, and compute where it and its solids are."""
    robot = read_robot(file, outside_arm.HOME, outside_arm.FLANGE)
    arm = arm_of(robot)
    assert np.isfinite(arm.forward(arm.home).position).all(), "the arm is nowhere"
    assert all(
        np.isfinite(solid.bounds()).all() for solid in robot_solids(robot, False)
    ), "a link is nowhere"


def one_case(seed: int, texts: list[bytes], folder: Path, counts: Counter[str]) -> None:
    rng = random.Random(seed)
    text = rng.choice(texts)
    arm, data, began, wrong = (
        text is texts[-1],
        changed(rng, text),
        time.monotonic(),
        "",
    )
    file = (
        folder / "outside_arm" / "urdf" / "changed.urdf"
        if arm
        else folder / "changed.urdf"
    )
    file.write_bytes(data)
    try:
        read_arm(file) if arm else read_scene(rng, file)
        counts["read"] += 1
    except UserError as error:
        counts["errors of one line"] += 1
        wrong = f"several lines: {error}" if len(str(error).splitlines()) != 1 else ""
    except Exception:
        wrong = traceback.format_exc()[-3000:]
    if (took := time.monotonic() - began) > SLOWEST_S:
        wrong = wrong or f"it took {took:.0f} s"
    counts["cases"] += 1
    if wrong:
        counts["findings"] += 1
        sys.stdout.write(
            f"-seed={seed} {'arm' if arm else 'scene'}\n{data[:3000]!r}\n{wrong}\n\n"
        )


def main() -> None:
    flags = dict(word.lstrip("-").split("=") for word in sys.argv[1:])
    seed, counts = int(flags.get("seed", "0")), Counter[str]()
    with (
        tempfile.TemporaryDirectory() as scratch,
        mock.patch.object(solids, "isolated", called),
        mock.patch.object(hulls, "isolated", called),
    ):
        texts = files(Path(scratch))
        for number in range(int(flags.get("runs", "1000"))):
            one_case(seed + number, texts, Path(scratch), counts)
    figures = ", ".join(
        f"{counts[what]} {what}"
        for what in ("cases", "read", "errors of one line", "findings")
    )
    sys.stdout.write(f"{figures}; next: -seed={seed + counts['cases']}\n")
    sys.exit(counts["findings"] > 0)


if __name__ == "__main__":
    main()
