"""What is said, drawn and recorded of a run: the listeners ``progress``, ``summary``, ``unseen`` and ``rerun``."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def listeners() -> Mapping[str, str]:
    return {
        "progress": "plugins.listeners.progress_listener:ProgressListener",
        "summary": "plugins.listeners.summary.listener:SummaryListener",
        "unseen": "plugins.listeners.unseen.listener:UnseenListener",
        "rerun": "plugins.listeners.rerun.listener:RerunListener",
    }
