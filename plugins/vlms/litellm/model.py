"""A language model behind an API: sends requests in parallel, within limits, and retries failed calls."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from core.errors import LimitReached, UsageError, UserError, check_positive
from core.hooks import hookimpl
from core.interfaces import VLM, Estimate, Reply, Request, Spending
from core.support.threads import run_in_thread
from plugins.vlms.litellm.client import Client, estimate
from plugins.vlms.litellm.failures import explain, pause, unanswered, within

_log = logging.getLogger(__name__)

_LIMITS = (
    "concurrency",
    "timeout_s",
    "requests_per_minute",
    "max_output_tokens",
    "max_cost_usd",
    "max_tokens_total",
)
"""Settings that are greater than 0, or None where this means no limit."""


@dataclass(eq=False)
class LanguageModel(VLM):
    """Asks a model through LiteLLM.

    Args:
        model: in LiteLLM's notation, ``provider/model``.
        api_base: address of the server; None: the provider's own.
        concurrency: calls that may wait for an answer at the same time.
        requests_per_minute: calls that may begin in a minute, evenly spaced; None: no limit.
        timeout_s: a call that takes longer is abandoned.
        retries: how often a call is repeated after a rate limit, a server error, a network error or a time-out.
        max_output_tokens: of an answer, thinking included; None: the provider's maximum.
        max_cost_usd: no further call is made once calls have cost this much; None: no limit.
        max_tokens_total: no further call is made once prompts and answers together have this many tokens; None: no
            limit.

    Raises:
        UserError: LiteLLM does not know the provider, or finds no API key; a cost limit without a known price.
    """

    takes_schema = True
    repairs = True

    model: str = ""
    api_base: str | None = None
    concurrency: int = 20
    requests_per_minute: float | None = None
    timeout_s: float = 600.0
    retries: int = 4
    max_output_tokens: int | None = None
    max_cost_usd: float | None = None
    max_tokens_total: int | None = None

    def __post_init__(self) -> None:
        if not self.model:
            raise UsageError(
                "vlm.model is empty; give provider/model, such as vlm.model=gemini/gemini-2.5-pro"
            )

        for name in _LIMITS:
            check_positive("vlm.", **{name: getattr(self, name)})

        if self.retries < 0:
            raise UsageError(f"vlm.retries must be at least 0, got {self.retries}")

        self._client = Client(
            self.model, self.api_base, self.timeout_s, self.max_output_tokens
        )
        self._limits: list[Spending] = []
        self.share(Spending(self.max_cost_usd, self.max_tokens_total))
        self._pace = Pace(self.requests_per_minute)
        self._answered: set[str] = set()  # ids of requests, in this process

    @classmethod
    def estimate(cls, request: Request, model: str) -> Estimate:
        return estimate(request, model)

    def share(self, limits: Spending) -> None:
        """Count calls towards a limit that others count towards too.

        Raises:
            UserError: a limit of cost, where LiteLLM knows no price.
        """
        if limits.max_cost_usd is not None and not self._client.priced:
            raise UserError(
                f"vlm.max_cost_usd can't be applied: LiteLLM's price list has no price for {self.model}; "
                "use vlm.max_tokens_total"
            )

        if limits.limited:
            self._limits.append(limits)

    @hookimpl
    def reply_received(self, request: Request, reply: Reply) -> None:
        """Count what a resumed run had already spent towards its limits."""
        if request.id not in self._answered and (
            reply.error is None or reply.prompt_tokens is not None
        ):
            self._spend(request, reply)

    def _spend(self, request: Request, reply: Reply) -> None:
        """Add what a reply cost to all limits."""
        if not self._limits:
            return  # counting takes its time

        tokens, cost_usd = self._client.spent(request, reply)
        for limits in self._limits:
            limits.add(tokens, cost_usd)

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`. When the caller closes the iterator, calls that have not begun are dropped.

        When a limit is reached, calls that are under way are completed.
        """
        waiting: queue.SimpleQueue[Request] = queue.SimpleQueue()
        for request in requests:
            waiting.put(request)

        results: queue.SimpleQueue[Reply | Exception] = queue.SimpleQueue()
        stop = threading.Event()

        def work() -> None:
            while not stop.is_set():
                try:
                    request = waiting.get_nowait()
                except queue.Empty:
                    return
                try:
                    results.put(self._answer(request, stop))
                except LimitReached as limit:
                    results.put(limit)
                except Exception as error:
                    results.put(self._failed(request, error))

        def ended(error: Exception | None) -> None:
            if error is not None:
                results.put(error)

        limits: list[LimitReached] = []
        try:
            for number in range(min(self.concurrency, len(requests))):
                run_in_thread(work, ended, f"{self.model} {number}")
            for _ in requests:
                result = results.get()
                if isinstance(result, LimitReached):
                    limits.append(result)
                elif isinstance(result, Exception):
                    raise result
                else:
                    self._answered.add(result.request_id)
                    yield result
        finally:
            stop.set()

        if limits:
            raise LimitReached(
                f"{limits[0]}; {len(limits)} of {len(requests)} requests are left without a reply"
            )

    def _answer(self, request: Request, stop: threading.Event) -> Reply:
        """Call the model until a call succeeds or the retries are used up.

        Args:
            request: that is sent.
            stop: set when nobody waits for the reply any more.

        Raises:
            LimitReached: a limit of cost or tokens is reached.
        """
        tries = 0
        while True:
            self._pace.wait(stop)
            if stop.is_set():
                return Reply(request.id, "", self.model, error="interrupted")

            self._check_limits()
            tries += 1

            try:
                reply, finish = within(
                    self.timeout_s, lambda: self._client.ask(request)
                )
            # any error of a server or of LiteLLM costs this reply only
            except Exception as error:
                wait_s = pause(error, tries)
                if tries > self.retries or wait_s is None:
                    after = f" (after {tries} tries)" if tries > 1 else ""
                    return self._failed(request, error, after)

                stop.wait(wait_s)
            else:
                self._spend(request, reply)
                return self._explain_empty(reply, finish)

    def _check_limits(self) -> None:
        """Raise LimitReached if one is."""
        for limits in self._limits:
            reached = limits.reached()
            if reached:
                raise LimitReached(reached)

    def _failed(self, request: Request, error: Exception, after: str = "") -> Reply:
        """Make the reply of a call that failed; ``after`` says after how many tries."""
        return Reply(
            request.id,
            "",
            self.model,
            error=explain(error) + after,
            unanswered=unanswered(error),
        )

    def _explain_empty(self, reply: Reply, finish: str) -> Reply:
        """Say in a reply why it has no text. A text that was cut off is passed on.

        Args:
            reply: of the model.
            finish: why it stopped, in the provider's words.
        """
        error = reply.error
        if error is not None:
            return reply
        if finish == "content_filter":
            error = "the provider's safety filter blocked the reply"
        elif finish == "length" and not reply.text.strip():
            error = "the length limit was reached before any text came; raise vlm.max_output_tokens"
        elif finish == "length":
            cut = f"the length limit cut off the reply to {reply.request_id}"
            _log.warning("%s: %s; see vlm.max_output_tokens", self.model, cut)
        elif not reply.text.strip():
            error = f"the reply is empty (finish reason: {finish})"

        return replace(reply, error=error)


@dataclass(eq=False)
class Gemini(LanguageModel):
    """Google's models, with a key in ``GEMINI_API_KEY``."""

    model: str = "gemini/gemini-2.5-pro"


@dataclass(eq=False)
class OpenAI(LanguageModel):
    """OpenAI's models, with a key in ``OPENAI_API_KEY``."""

    model: str = "openai/gpt-5.4"


@dataclass(eq=False)
class Anthropic(LanguageModel):
    """Anthropic's models, with a key in ``ANTHROPIC_API_KEY``."""

    model: str = "anthropic/claude-sonnet-4-6"


@dataclass(eq=False)
class Ollama(LanguageModel):
    """A model on the user's own machine, which is slow and answers few requests in parallel."""

    model: str = "ollama_chat/qwen3-vl:8b"
    concurrency: int = 2
    timeout_s: float = 1800.0


class Pace:
    """Space the calls of all threads evenly, ``per_minute`` of them; None: no spacing."""

    def __init__(self, per_minute: float | None) -> None:
        self._gap_s = 60.0 / per_minute if per_minute is not None else 0.0
        self._free_at = 0.0  # earliest start of the next call, on the monotonic clock
        self._lock = threading.Lock()

    def wait(self, stop: threading.Event) -> None:
        """Wait for the caller's turn, or until ``stop`` is set."""
        with self._lock:
            begin = max(time.monotonic(), self._free_at)
            self._free_at = begin + self._gap_s

        stop.wait(max(0.0, begin - time.monotonic()))
