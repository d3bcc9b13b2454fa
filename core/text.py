"""Words of strangers, made fit for a line that a person reads."""

from __future__ import annotations


def clean(text: str, longest: int) -> str:
    """``text`` on one line, without control characters, at most ``longest`` characters."""
    printable = "".join(character for character in " ".join(text.split()) if character.isprintable())
    return printable if len(printable) <= longest else printable[: longest - 3] + "..."


def kind(value: object) -> str:
    """What a JSON value is, for a reason."""
    names: dict[type, str] = {dict: "an object", list: "a list", bool: "a boolean", type(None): "null"}
    if isinstance(value, str):
        return f"the text {shorten(value)}"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "a number"
    return names.get(type(value), f"a {type(value).__name__}")


def shorten(text: str, length: int = 40) -> str:
    """``text`` quoted, with what is beyond ``length`` characters left out."""
    return repr(text if len(text) <= length else text[: length - 3] + "...")
