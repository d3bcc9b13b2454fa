"""Read and write the tool of a design, with its fixture: what a design adds to the scene, where a task has a place.

In a designs document a fixture is the field ``fixture`` of a design: the fields of its tool representation, as of a
rigid tool, and the ``pose`` [x, y, z, roll, pitch, yaw] of its mount's frame in the world.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from typing import Any

from core.design import DesignError, Fixture, Tool
from core.designs.plan_rules import check_waypoint
from core.designs.replies import Fields, Unread, reader
from core.designs.rules import MAX_MOUNT_GAP_M, check_gripper
from core.geometry import Pose
from core.interfaces import Task, ToolRepresentation
from core.plugins import describe_part
from core.plugins.blame import call_part
from core.robot.solids import Solid, closest, solids_of
from core.scene import FIXTURE, Region
from core.support.text import clean, kind
from core.values.refusals import DesignReason

MAX_OVERLAP_M = 1e-4
"""The most that a fixture may be inside anything at the start."""

NOTE = "note"
"""The field of a design in which its designer may keep what it was made of, as JSON."""

MAX_NAME = 200  # characters
MAX_DESCRIPTION = 5000


def read_fields(
    design: object, representation: ToolRepresentation, what: str = "the design"
) -> Fields:
    """Return the fields of a design, or of its fixture, by their proper names.

    Raises:
        DesignError: it can't be read, or a name has two meanings.
    """
    if isinstance(design, Unread):
        raise DesignError(design.reason)
    if not isinstance(design, dict):
        raise DesignError.because(DesignReason.NO_OBJECT, what=what, given=kind(design))
    return reader().read_fields(design, call_part(representation, "schema", dict))


def read_gripper(fields: Fields, given: Tool | None, task: Task) -> bool:
    """Read whether the tool needs the gripper; of a given tool that is known.

    Raises:
        DesignError: neither true nor false is written, or the robot has no gripper.
    """
    if given is not None:
        return given.gripper

    gripper = fields.get("gripper", False)
    if not isinstance(gripper, bool):
        raise DesignError.because(DesignReason.GRIPPER_WORD, given=kind(gripper))

    if gripper:
        check_gripper(task.robot)
    return gripper


def read_tool(
    fields: Fields, representation: ToolRepresentation, gripper: bool, task: Task
) -> Tool:
    """Read a design's tool, with its name and description, and its fixture.

    Raises:
        DesignError: a rule is broken; or the representation fails, then the message names its plugin.
    """
    name = read_words(fields, "tool_name")
    description = read_words(fields, "tool_description")
    tool: Tool = call_part(representation, "parse", Tool, fields, gripper=gripper)
    if tool.gripper != gripper:
        mount = "for the fingers" if tool.gripper else "for the flange"
        raise DesignError(
            f"{describe_part(representation)}: parse gave a tool {mount}, and gripper={gripper} was asked for"
        )

    weighed = representation.material.made(tool)
    fixture = _read_fixture(fields.get(FIXTURE), representation, task)
    weighed = replace(weighed, fixture=fixture)
    keys = [*call_part(representation, "schema", dict), FIXTURE, NOTE]
    text = json.dumps({key: fields[key] for key in keys if key in fields}, default=str)
    return replace(
        weighed, name=name, description=description, written=(weighed.content, text)
    )


def read_words(fields: Fields, name: str) -> str:
    """Read a text that only describes: whatever stands there, no design is lost by it."""
    longest = MAX_NAME if name.endswith("_name") else MAX_DESCRIPTION
    text = fields.get(name) or ""
    return clean(
        text if isinstance(text, str) else json.dumps(text, default=str), longest
    )


def dump_tool(tool: Tool, representation: ToolRepresentation) -> dict[str, Any]:
    """Write a tool: as it was read where it is still that, so that it comes back to the last bit."""
    content, text = tool.written
    if content != tool.content:
        return representation.dump(tool) | dump_fixture(tool, representation)
    found: dict[str, Any] = json.loads(text)
    return found


def _read_fixture(
    given: object, representation: ToolRepresentation, task: Task
) -> Fixture | None:
    """Read the fixture of a design, from what it has in this field; None: it has none.

    Raises:
        DesignError: the task has no place for one, or it can't be read.
    """
    if given is None:
        return None
    if task.fixture is None:
        raise DesignError.because(DesignReason.NO_PLACE, task=task.name)
    fields = read_fields(given, representation, "'fixture'")
    numbers: Any = fields.get("pose")
    check_waypoint(numbers, "fixture: pose", gripper=False)
    parts: Tool = call_part(representation, "parse", Tool, fields, gripper=False)
    if parts.bearers:
        raise DesignError.because(DesignReason.FIXTURE_JOINT)
    pose = Pose.xyz_rpy(numbers[:3], numbers[3:])
    # A design does not choose which way is up where goals measure at it.
    return Fixture(representation.material.made(parts), pose).upright


def dump_fixture(tool: Tool, representation: ToolRepresentation) -> dict[str, Any]:
    """Write the fixture of a tool's design, as a field of a design; none: there is no field."""
    fixture = tool.fixture
    if fixture is None:
        return {}
    pose = [*fixture.pose.position.tolist(), *fixture.pose.rpy]
    return {FIXTURE: {"pose": pose, **representation.dump(fixture.parts)}}


def find_fixture_faults(
    fixture: Fixture,
    region: Region | None,
    fixed: Set[str],
    others: Sequence[Solid],
) -> Iterator[DesignError]:
    """Say what is wrong with where a fixture stands.

    Args:
        fixture: what stands there.
        region: where it may; None: nowhere.
        fixed: the names of bodies on which it may stand.
        others: what else there is at the start.
    """
    if region is None:
        yield DesignError("the scene has no place for a fixture")
        return

    for component in fixture.parts.components:
        name = component.name
        _, pose = fixture.parts.placed()[component.name]
        parts = solids_of(component.name, component.shape, fixture.pose @ pose)
        if any(not region.holds(*part.bounds()) for part in parts):
            yield DesignError.because(
                DesignReason.FIXTURE_OUTSIDE,
                component=name,
                low=region.low,
                high=region.high,
            )

        least = math.inf
        for other in others:
            gap, _, _ = closest(parts, [other])
            if other.name in fixed:
                least = min(least, gap)
            if gap < -MAX_OVERLAP_M:
                yield DesignError.because(
                    DesignReason.FIXTURE_INSIDE,
                    component=name,
                    depth_mm=-1000 * gap,
                    other=other.name,
                )

        if component.parent in fixture.parts.mounts and least > MAX_MOUNT_GAP_M:
            yield DesignError.because(
                DesignReason.FIXTURE_HANGS, component=name, gap_mm=1000 * least
            )
