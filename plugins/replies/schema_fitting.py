"""Fit what a model wrote to the JSON schema of what was asked for, where it has one meaning.

Names, numbers, units, vectors and words are read here, for waypoints, anchored plans, components and their joints
alike. What can't be fitted stays as it is: its representation refuses it, and says what is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from PIL import ImageColor

from core.design import DesignError
from core.support.text import shorten
from plugins.replies.assumptions import assume
from plugins.replies.envelopes import plain_name
from plugins.replies.mending import mend_json
from plugins.replies.spellings import (
    DESCRIBES,
    WORDS,
    Named,
    Spelling,
    name_key,
    spelling_of,
)
from plugins.replies.written_numbers import ANGLES, LENGTHS, read_figure

Schema = Mapping[str, Any]
Fields = dict[Any, Any]

ANSWERS = {
    **dict.fromkeys(("true", "yes", "1"), True),
    **dict.fromkeys(("false", "no", "none", "0"), False),
}
"""Words for true and false."""

MAX_DEPTH = 6
"""How deep objects are fitted within each other."""

_BETWEEN = re.compile(r"[\s,;]+")
_BRACKETS = " \t\n[](),;"
_UNNAMED = re.compile(r"[^\w.-]+")
_MOUNTS = frozenset(
    ("", "none", "null", "flange", "mount", "toolmount", "endeffector", "eef", "ee")
)
_HOLDERS = frozenset(
    (
        *("geometry", "pose", "transform", "placement", "frame", "dimensions"),
        *("parameters", "params", "tempo", "timing", "guard", "collision", "visual"),
    )
)
_POSES = ("pose", "transform", "waypoint")
_SIDES = (("length", "width", "height"), ("length", "width", "thickness"))
_HEIGHTS = ("height", "h", "depth", "thickness")


def fit(value: object, schema: Schema, name: str = "", depth: int = MAX_DEPTH) -> Any:
    """Return a value in the form of a schema; as it is, as far as it can't be fitted.

    Args:
        value: what a model wrote.
        schema: of JSON, without references.
        name: of the field, which says its units.
        depth: how deep objects may still lie.

    Raises:
        DesignError: something is given twice, with different values.
    """
    schema = _unite(schema)
    wanted = schema.get("type")
    if depth == 0 or value is None:
        return value

    if wanted == "object" and "properties" in schema:
        required = schema.get("required", ())
        return _fit_object(value, schema["properties"], required, depth)
    if wanted == "array":
        return _fit_list(value, schema, name, depth)
    if wanted in ("number", "integer"):
        return read_number(value, spelling_of(name).units)
    if wanted == "boolean":
        return ANSWERS.get(str(value).strip().lower(), value)
    if "enum" in schema or "const" in schema:
        return _fit_word(value, schema.get("enum", [schema.get("const")]))
    if wanted == "string":
        return _fit_text(value, name)

    return value


def read_number(value: object, units: Mapping[str, float], unit: str = "") -> Any:
    """Return the number that a text means; anything else as it is.

    Args:
        value: what a model wrote.
        units: of which one may follow the number.
        unit: that its key says; empty: none.
    """
    if isinstance(value, bool):
        return value
    if unit and isinstance(value, int | float):
        return value / units[unit] if unit in units else f"{value} {unit}"
    if not isinstance(value, str):
        return value

    text = f"{value} {unit}" if unit else value
    number = read_figure(text, units)
    return value if number is None else number


def read_vector(
    value: object, spelling: Spelling, unit: str = "", *, whole: bool
) -> Any:
    """Return a vector as a list of three numbers, which may be written as an object, or as a text; else as it is.

    Args:
        value: what a model wrote.
        spelling: of the vector: its units, and the names of its parts.
        unit: that its key says; empty: none.
        whole: no part may be left out, which else is 0.
    """
    numbers: Any = value
    if isinstance(value, str):
        words = _BETWEEN.split(value.strip(_BRACKETS))
        numbers = words if len(words) == 3 else value
    elif isinstance(value, dict):
        parts = {str(key).strip().lower(): number for key, number in value.items()}
        if parts.keys() <= {*spelling.parts} and not (whole and len(parts) < 3):
            numbers = [parts.get(part, 0) for part in spelling.parts]

    if not isinstance(numbers, list):
        return value

    read = [read_number(number, spelling.units, unit) for number in numbers]
    is_text = isinstance(value, str) and any(isinstance(n, str) for n in read)
    return value if is_text else read


def _unite(schema: Schema) -> Schema:
    """Return the schema of a value that is not null; of several kinds of objects that of all their properties."""
    options = [
        option
        for option in schema.get("anyOf", [schema])
        if option.get("type") != "null"
    ]
    if len(options) == 1:
        return dict(options[0])

    properties: dict[str, Any] = {}
    for option in options:
        for key, inner in option.get("properties", {}).items():
            words = properties.get(key, {}).get("enum", []) + inner.get("enum", [])
            properties[key] = {**inner, "enum": words} if words else inner

    return {"type": "object", "properties": properties} if properties else {}


def _fit_list(value: object, schema: Schema, name: str, depth: int) -> Any:
    """Fit a list: of numbers, of texts, or of objects, which may stand under their names."""
    items = schema.get("items", {})
    count = schema.get("minItems")
    is_vector = items.get("type") == "number" and count == schema.get("maxItems")
    if is_vector and count == 3:
        whole = name in ("size", "xyz")
        return read_vector(value, spelling_of(name), whole=whole)

    if isinstance(value, str):
        value = _read_list(value, items)

    item = _unite(items)
    if item.get("type") == "object" and isinstance(value, dict):
        value = list(_list_named(value, item["properties"]))
    if not isinstance(value, list):
        return value

    return [fit(inner, items, name, depth) for inner in value]


def _read_list(text: str, items: Schema) -> Any:
    """Read a list that stands in a text, or a text that stands for a list of it alone."""
    if text.lstrip().startswith("["):
        try:
            return mend_json(text)
        except DesignError:
            return text

    return [text] if items.get("type") == "string" and text.strip() else text


def _list_named(value: Fields, properties: Mapping[str, Any]) -> Iterator[Any]:
    """Yield the objects that stand under their names, or the one that stands alone."""
    is_by_name = all(isinstance(inner, dict) for inner in value.values())
    if not is_by_name or any(name_key(key, properties) for key in value):
        yield value
        return

    assume("a list of objects under their names is read as one")
    for key, inner in value.items():
        has_name = "name" not in properties or "name" in inner
        yield inner if has_name else {"name": key, **inner}


def _fit_word(value: object, words: Iterable[Any]) -> object:
    """Return the word that is meant, of a few; else the value."""
    plain = plain_name(value)
    known = {plain_name(word): word for word in words if isinstance(word, str)}
    meant = known.get(plain, known.get(plain_name(WORDS.get(plain, plain))))
    if meant is not None and meant != value:
        assume(f"{shorten(str(value))} is read as {meant!r}")

    return value if meant is None else meant


def _fit_text(value: object, name: str) -> object:
    """Make a text of a list of lines, of an object that holds it, or of a number; of names and colours what can be."""
    if name == "color":
        return _read_color(value)
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    if name == "solid":
        return _read_tree(value)

    lines = list(value.values()) if isinstance(value, dict) else value
    if isinstance(lines, list) and all(isinstance(line, str) for line in lines):
        return "\n".join(lines)
    if name in ("name", "parent") and isinstance(value, str):
        return _UNNAMED.sub("_", value.strip())

    return value


def _read_color(value: object) -> str | None:
    """Read a colour as hexadecimal; None: it can't be read, and no design is lost by that."""
    if isinstance(value, list) and 3 <= len(value) <= 4:
        shares = [n for n in value[:3] if isinstance(n, int | float)]
        most = 1.0 if all(0 <= n <= 1 for n in shares) else 255.0
        if len(shares) == 3 and all(0 <= n <= most for n in shares):
            return "#" + "".join(f"{round(255 * n / most):02x}" for n in shares)

    try:
        red, green, blue, *_ = ImageColor.getrgb(str(value).strip()[:40])
    except ValueError:
        assume(f"the colour {shorten(str(value))} is left out")
        return None

    return f"#{red:02x}{green:02x}{blue:02x}"


def _read_tree(value: object) -> object:
    """Read the numbers of a tree of shapes, which is JSON, perhaps in a text."""
    if isinstance(value, str):
        try:
            value = mend_json(value)
        except DesignError:
            return value
    if isinstance(value, dict):
        return {
            str(key).strip().lower(): _read_tree(inner) for key, inner in value.items()
        }
    if isinstance(value, list):
        return [
            read_number(inner, LENGTHS | ANGLES)
            if isinstance(inner, str)
            else _read_tree(inner)
            for inner in value
        ]

    return value


# --- objects ----------------------------------------------------------------------------------------------------


def _fit_object(
    value: object,
    properties: Mapping[str, Any],
    required: Collection[str],
    depth: int,
) -> Any:
    """Fit an object: its fields by their names, without what is null or only describes it.

    Args:
        value: what a model wrote.
        properties: the schemas of its fields, by name.
        required: the fields that may not be left out.
        depth: how deep objects may still lie.

    Raises:
        DesignError: a field is given twice, with different values.
    """
    if isinstance(value, list):
        value = _name_numbers(value, properties)
    if not isinstance(value, dict):
        return value

    found: Fields = {}
    parts: dict[str, Fields] = {}
    others: Fields = {}
    pairs = sorted(
        _flatten(value, properties, depth), key=lambda pair: pair[0] not in properties
    )
    for key, inner in pairs:
        named = name_key(key, properties)
        is_text = inner is None or isinstance(inner, str)
        is_description = plain_name(key) in DESCRIBES and key not in properties
        if inner is None:
            continue
        if named is None:
            if not (is_description and (is_text or isinstance(inner, list | int))):
                others[key] = inner
            continue

        if named.part:
            part = f"{inner} {named.unit}" if named.unit else inner
            parts.setdefault(named.name, {})[named.part] = part
            continue

        fitted = _fit_field(inner, named, properties[named.name], depth)
        if fitted is None:
            continue
        if found.setdefault(named.name, fitted) != fitted and not is_description:
            raise DesignError(
                f"{named.name!r} is given twice, also as {shorten(str(key))}; give it once, with that name"
            )

    for name, inner in parts.items():
        if name in found:
            raise DesignError(
                f"{', '.join(inner)} is given twice, also in {name!r}; give it once"
            )

        whole = name == "xyz"
        found[name] = read_vector(inner, spelling_of(name), whole=whole)

    _name_sides(found, others, properties)
    is_optional = "parent" in properties and "parent" not in required
    if is_optional and plain_name(found.get("parent", "")) in _MOUNTS:
        found.pop("parent", None)

    return {**found, **others}


def _fit_field(inner: object, named: Named, schema: Schema, depth: int) -> Any:
    """Fit the value of a field, with the unit and the factor that its key says."""
    spelling = spelling_of(named.name)
    schema = _unite(schema)
    is_number = schema.get("type") == "number"
    fitted = fit(inner, schema, named.name, depth - 1)
    if named.unit and (spelling.parts or is_number):
        if is_number:
            fitted = read_number(inner, spelling.units, named.unit)
        else:
            whole = named.name in ("size", "xyz")
            fitted = read_vector(inner, spelling, unit=named.unit, whole=whole)
    if named.factor == 1.0:
        return fitted

    assume(f"a field that is not asked for is read as {named.name!r}")
    if isinstance(fitted, int | float):
        return named.factor * fitted
    if isinstance(fitted, list) and all(isinstance(n, int | float) for n in fitted):
        return [named.factor * number for number in fitted]

    return fitted


def _flatten(
    value: Fields, properties: Mapping[str, Any], depth: int
) -> Iterator[tuple[Any, Any]]:
    """Yield keys and values; those of an object within that holds fields by their own names."""
    words = properties.get("shape", {}).get("enum", ())
    for key, inner in value.items():
        shape = _fit_word(key, words)
        if shape in words and name_key(key, properties) is None:
            # As in {"box": [0.1, 0.1, 0.1]}, {"sphere": {"radius": 0.1}}.
            yield "shape", shape
            yield from _flatten_shape(inner, properties, depth)
        elif (
            depth > 0
            and isinstance(inner, dict)
            and _holds_fields(key, inner, properties)
        ):
            yield from _flatten_inner(key, inner, properties, depth)
        elif isinstance(inner, list) and plain_name(key) in _POSES:
            named = _name_numbers(inner, properties)
            yield from named.items() if isinstance(named, dict) else [(key, inner)]
        else:
            yield key, inner


def _flatten_shape(
    inner: object, properties: Mapping[str, Any], depth: int
) -> Iterator[tuple[Any, Any]]:
    """Yield what stands under the name of a shape: its sizes."""
    if isinstance(inner, dict):
        yield from _flatten(inner, properties, depth - 1)
    elif isinstance(inner, list):
        yield "size", inner
    else:
        yield "radius", inner


def _holds_fields(key: object, inner: Fields, properties: Mapping[str, Any]) -> bool:
    """Report whether an object is no value of its key, but holds fields of the object around it."""
    named = name_key(key, properties)
    if named is None:
        is_holder = plain_name(key) in _HOLDERS
        return is_holder and any(name_key(name, properties) for name in inner)

    schema = _unite(properties[named.name])
    if schema.get("type") == "array":
        parts = spelling_of(named.name).parts
        known = [name for name in inner if str(name).strip().lower() not in parts]
        return bool(known) and all(name_key(name, properties) for name in known)

    return schema.get("type") in ("string", "number") and named.name != "solid"


def _flatten_inner(
    key: object, inner: Fields, properties: Mapping[str, Any], depth: int
) -> Iterator[tuple[Any, Any]]:
    """Yield the fields in an object; where it is one of a text, such as an anchor, its name is that text."""
    named = name_key(key, properties)
    for name, held in _flatten(inner, properties, depth - 1):
        is_name = plain_name(name) in ("name", "type") and name not in properties
        if named is not None and is_name:
            yield named.name, held
        else:
            yield name, held


def _name_numbers(values: list[Any], properties: Mapping[str, Any]) -> Any:
    """Name the numbers of a pose: those of its place, of its turn, and that of the gripper; else return them."""
    place = next((n for n in ("offset", "position", "xyz") if n in properties), None)
    is_flat = not any(isinstance(value, list | dict) for value in values)
    names = "rpy" in properties and len(values) in (6, 7)
    has_grip = len(values) == 6 or "grip" in properties
    if place is None or not (is_flat and names and has_grip):
        return values

    named = {place: values[:3], "rpy": values[3:6]}
    return {**named, "grip": values[6]} if len(values) == 7 else named


def _name_sides(found: Fields, others: Fields, properties: Mapping[str, Any]) -> None:
    """Name the sides of a box, and the height of a cylinder, which stand under names of their own."""
    if "size" not in properties:
        return

    sides = {plain_name(key): key for key in others}
    shape = found.get("shape", "box")
    if shape == "box" and "size" not in found:
        for names in _SIDES:
            left = [name for name in names[1:] if name in sides]
            if "length" in found and len(left) == 2:
                rest = [others.pop(sides[name]) for name in left]
                numbers = [found.pop("length"), *rest]
                found["size"] = read_vector(numbers, spelling_of("size"), whole=True)
                assume("length, width and height of a box are read as x, y and z")
                return

    heights = [sides[name] for name in _HEIGHTS if name in sides]
    if shape in ("cylinder", "capsule") and "length" not in found and len(heights) == 1:
        height = others.pop(heights[0])
        found["length"] = read_number(height, spelling_of("length").units)
