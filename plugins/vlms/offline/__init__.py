"""The embedded designer: answers requests without a language model."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def vlms() -> Mapping[str, str]:
    return {"offline": "plugins.vlms.offline.designer:OfflineDesigner"}
