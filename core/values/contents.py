"""Hash what values hold, so that equal designs are known as such in every process."""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass

import numpy as np


def digest(content: object) -> str:
    """Hash nested tuples of plain values."""
    return hashlib.blake2b(repr(content).encode(), digest_size=16).hexdigest()


def content_of(value: object) -> object:
    """Write a value as nested tuples. Fields with their default are left out, so that a new field changes no hash."""
    if is_dataclass(value):
        named = [(item, getattr(value, item.name)) for item in fields(value)]
        given = [
            (f.name, content_of(v))
            for f, v in named
            if not (type(v) is type(f.default) and v == f.default)
        ]
        return type(value).__name__, *given

    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, tuple):
        return tuple(content_of(item) for item in value)
    return value
