"""Handle a failed call: the wait before the next try, and a message without keys."""

from __future__ import annotations

import random
import re
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

from core.support.secrets import scrub
from core.support.text import clean
from plugins.vlms.litellm.manner import says_no
from plugins.vlms.litellm.room import is_too_long
from plugins.vlms.litellm.transport import BadAnswer, TimedOut, Unanswered

TRIES = 5  # of a call; a server that is away for longer is waited for by the run (`patience_s`)
FIRST_WAIT_S = 1.0
MAX_WAIT_S = 60.0
MAX_REQUESTED_WAIT_S = 300.0  # a server that requests a longer wait means a daily quota
MAX_MESSAGE = 400
LONGEST_READ = 10_000  # characters of an error, which may hold a whole answer

# Statuses of what may be mended without changing the request: a key, an account, a name, an address, a crowd.
_PASSING = (401, 402, 403, 404, 407, 408, 429)
# What some providers send with status 400.
_ACCOUNT = re.compile(r"api.?key|credit balance|billing|quota", re.IGNORECASE)
# What gateways send with status 400 where others send 404.
_NO_MODEL = re.compile(
    r"invalid model name|not a valid model|no such model", re.IGNORECASE
)


def pause(error: Exception, tries: int) -> float | None:
    """Seconds to wait before the next try after ``tries``; None: there were enough, or another would fail too.

    Args:
        error: of the last try.
        tries: made so far.
    """
    if tries >= TRIES:
        return None

    status = _status(error)
    if not isinstance(error, TimedOut) and status not in (408, 429) and status < 500:
        return None
    if refuses(error) or is_too_long(find_words(error)):
        return None
    if "insufficient_quota" in str(error):
        return None

    requested = _retry_after(error)
    if requested is not None:
        return requested if requested <= MAX_REQUESTED_WAIT_S else None

    # At random, so that agents that were refused together do not retry together.
    jitter = random.uniform(0.75, 1.25)  # noqa: S311
    return min(MAX_WAIT_S, FIRST_WAIT_S * 2.0 ** (tries - 1)) * jitter


def unanswered(error: Exception) -> bool:
    """Say if a call that failed is to be made again when the run goes on.

    It is, unless the provider refused the request itself, or its answer is not read.
    """
    if isinstance(error, BadAnswer):
        return isinstance(error, Unanswered)

    if is_too_long(find_words(error)):
        return True  # the server may have a larger context then

    status = _status(error)
    if not 400 <= status < 500 or status in _PASSING:
        return True

    words = find_words(error)
    found = _ACCOUNT.search(words) or _NO_MODEL.search(words)
    return found is not None


def refuses(error: Exception) -> bool:
    """Say if a server refuses the request itself, whatever the status: another try would fail too."""
    if isinstance(error, BadAnswer | TimedOut):
        return False

    status = _status(error)
    if 400 <= status < 500:
        return status not in _PASSING and not _NO_MODEL.search(find_words(error))

    return status >= 500 and says_no(find_words(error))


def find_words(error: Exception) -> str:
    """Return what an error says, as long as it is read."""
    return " ".join(str(error).split())[:LONGEST_READ]


def _status(error: Exception) -> int:
    """The HTTP status, or LiteLLM's substitute (500 for a broken connection); 0: none."""
    status = getattr(error, "status_code", 0)
    return int(status) if isinstance(status, int | str) and str(status).isdigit() else 0


def _retry_after(error: Exception) -> float | None:
    """The wait that the server requests, in seconds: from a header (seconds or a date), or from the body (Google).

    Dates count from this machine's clock. None: the server requests nothing, or nothing that can be read.
    """
    headers = getattr(error, "litellm_response_headers", None)
    if headers is None:
        headers = getattr(getattr(error, "response", None), "headers", None)

    header = str((headers or {}).get("retry-after", "")).strip()
    if re.fullmatch(r"\d+(\.\d+)?", header):
        return float(header)

    if header:
        try:
            date = parsedate_to_datetime(header)
            return max(0.0, (date - datetime.now(UTC)).total_seconds())
        except (ValueError, TypeError, OverflowError):
            return None

    body = re.search(r'"retryDelay":\s*"(\d+(?:\.\d+)?)s"', str(error))
    return float(body.group(1)) if body else None


def explain(error: Exception) -> str:
    """Say in one line what went wrong, without keys."""
    text = find_words(error).partition("Traceback (most recent call last)")[0]
    text = text.replace("litellm.", "")
    if not isinstance(error, TimedOut | BadAnswer):
        name = f"{type(error).__name__}: "
        text = name + text.replace(name, "")

    return clean(scrub(text), MAX_MESSAGE)
