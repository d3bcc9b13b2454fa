"""The reader of designs: envelopes, syntax, fields and plans."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from core.design import DesignError
from core.designs.replies import Fields, Reader
from core.plugins import installed
from plugins.replies.envelopes import find_designs
from plugins.replies.fields import ACTION_SETS, list_plans, read_fields
from plugins.replies.mending import ELLIPSIS
from plugins.replies.saving import read_reply
from plugins.replies.schema_fitting import fit
from plugins.replies.written_waypoints import read_waypoints


class LenientReader(Reader):
    """Reads what has one meaning, and says what to write where there are two."""

    def read_reply(self, text: str) -> object:
        return read_reply(text)

    def list_designs(self, document: object) -> list[Any]:
        return find_designs(document)

    def read_fields(self, design: Fields, wanted: Mapping[str, Any]) -> Fields:
        fields = read_fields(design, wanted)
        if "action" not in fields:
            fields |= _name_action(fields.get(ACTION_SETS))

        return fields

    def list_plans(
        self, value: object, schema: Mapping[str, Any], *, gripper: bool
    ) -> object:
        plans = list_plans(value, schema)
        if not isinstance(plans, list):
            return plans

        return [_read_plan(plan, schema, gripper) for plan in plans]


def _name_action(plans: object) -> Fields:
    """Return the field ``action`` of plans that can only be written in one representation: objects with its fields.

    A reply to a run does not name the representation, which its reader knows there; as a designs file it is read by it.
    """
    item = plans
    while isinstance(item, list) and item:
        item = item[0]

    if not (isinstance(item, dict) and item):
        return {}

    names = []
    for name, factory in installed().factories("action").items():
        actions = factory()
        actions.guards = (
            True  # a plan may have them, whether or not a run tells of them
        )
        actions.looks = True
        schema = actions.schema(gripper=True).get("items", {})
        forms = schema.get("anyOf", [schema])
        if any(item.keys() <= form.get("properties", {}).keys() for form in forms):
            names.append(name)

    return {"action": names[0]} if len(names) == 1 else {}


def _read_plan(plan: object, schema: Mapping[str, Any], gripper: bool) -> object:
    """Read a plan of poses, or of objects; an error in its place says what is wrong."""
    items = schema.get("items", {})
    try:
        if items.get("items") == {"type": "number"}:
            return read_waypoints(plan, gripper=gripper)
        if isinstance(plan, list) and items.get("type") == "object":
            return [
                _read_step(step, items, number) for number, step in enumerate(plan, 1)
            ]
    except DesignError as error:
        return error

    return plan


def _read_step(step: object, schema: Mapping[str, Any], number: int) -> object:
    """Read one waypoint of a plan of objects.

    Raises:
        DesignError: it is left out, or says something twice.
    """
    if step == ELLIPSIS:
        raise DesignError(f"waypoint {number} is '...'; write out every waypoint")
    try:
        return fit(step, schema)
    except DesignError as error:
        raise DesignError(f"waypoint {number}: {error}") from error
