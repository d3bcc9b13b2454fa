"""Read designs in the many spellings of models, where they have one meaning."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def readers() -> Mapping[str, str]:
    return {"designs": "plugins.replies.lenient_reader:LenientReader"}
