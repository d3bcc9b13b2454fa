"""Cache replies on disk, so that the same request is not sent and paid for twice.

An entry is a JSON file that is written atomically: any number of processes may share a folder and be killed at any
time. An entry that can't be read counts as missing.
"""

from __future__ import annotations

import hashlib
import json
import logging
from pathlib import Path
from typing import Any

import platformdirs

from core.errors import UserError
from core.interfaces import Reply, Request
from core.support.files import write_whole
from plugins.vlms.litellm.client import render

_VERSION = 1  # of keys and entries
_STORED = ("text", "model", "prompt_tokens", "completion_tokens", "cost_usd")

_log = logging.getLogger(__name__)


class Cache:
    """Replies under ``folder``; None: ``vlmgineer/replies`` in the user's cache folder.

    ``settings`` are what a reply depends on apart from the request, such as the model and the server's address.

    Raises:
        UserError: the folder can't be made.
    """

    def __init__(self, folder: str | None, settings: dict[str, Any]) -> None:
        self.folder = Path(folder) if folder else platformdirs.user_cache_path("vlmgineer") / "replies"
        self._settings = settings
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(
                f"the cache folder {self.folder} can't be made: {error.strerror}; set vlm.cache_dir"
            ) from error

    def file(self, request: Request) -> Path:
        """The path of the entry for a request, whether it exists or not."""
        content = {
            "version": _VERSION,
            **self._settings,
            "messages": render(request.messages),
            "schema": request.schema,
            "temperature": request.temperature,
            "seed": request.brief.seed,
        }
        key = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
        return self.folder / key[:2] / f"{key}.json"

    def get(self, request: Request) -> Reply | None:
        """The cached reply, at no cost; None: there is none."""
        try:
            entry = json.loads(self.file(request).read_text(encoding="utf-8"))
            text, model = entry["text"], entry["model"]
            tokens = entry["prompt_tokens"], entry["completion_tokens"]
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return None
        if not (isinstance(text, str) and isinstance(model, str)):
            return None
        if not all(number is None or isinstance(number, int) for number in tokens):
            return None
        return Reply(request.id, text, model, None, *tokens, cost_usd=0.0)

    def put(self, request: Request, reply: Reply) -> None:
        """Write a reply that is not an error."""
        file = self.file(request)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps({name: getattr(reply, name) for name in _STORED})
            write_whole(file, text.encode(), shared=True)
        except OSError as error:  # the run has the reply all the same
            _log.warning("the reply to %s can't be cached in %s: %s", request.id, file.parent, error.strerror)
