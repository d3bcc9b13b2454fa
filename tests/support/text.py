"""Change a text, and be told where that changes nothing."""

import csv


def replaced(text: str, *changes: tuple[str, str]) -> str:
    """Replace the first of each old text by its new one; a test whose replacement replaces nothing tests nothing."""
    for old, new in changes:
        assert old in text, f"there is no {old!r} to replace"
        text = text.replace(old, new, 1)
    return text


def replaced_all(text: str, *changes: tuple[str, str]) -> str:
    """Replace each old text by its new one wherever it stands; that it stands nowhere is an error."""
    for old, new in changes:
        assert old in text, f"there is no {old!r} to replace"
        text = text.replace(old, new)
    return text


def read_csv(file):
    with file.open(newline="", encoding="utf-8") as opened:
        return list(csv.DictReader(opened))
