"""A language model behind an API: all requests at once, within limits; a call that fails is tried again, then told."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from core.errors import LimitReached, UsageError, UserError, check_positive
from core.hooks import hookimpl
from core.interfaces import VLM, Estimate, Reply, Request
from plugins.vlms.litellm.cache import Cache
from plugins.vlms.litellm.client import Answer, Client, estimate
from plugins.vlms.litellm.failures import explain, pause, within
from plugins.vlms.litellm.spending import Spending

_log = logging.getLogger(__name__)


@dataclass(eq=False)
class LanguageModel(VLM):
    """Asks a model through LiteLLM.

    Args:
        model: as LiteLLM writes it, ``provider/model``.
        api_base: address of the server; None: the provider's own.
        concurrency: calls that may wait for an answer at the same time.
        requests_per_minute: calls that may begin in a minute, evenly spaced; None: no limit.
        timeout_s: a call that takes longer is given up, whatever the server does.
        retries: how often a call is tried again after a rate limit, a fault of the server or of the network.
        max_output_tokens: of an answer, thinking included; None: what the provider allows.
        max_cost_usd: when calls have cost as much, no further one is made; None: no limit.
        max_tokens_total: the same for tokens, of prompts and answers together.
        cache: keep replies, and don't send a request again whose reply is kept.
        cache_dir: where; None: ``vlmgineer/replies`` in the user's cache folder.

    Raises:
        UserError: LiteLLM does not know the provider, or finds no API key; a limit of cost without a price; a cache
            folder that can't be made.
    """

    model: str = ""
    api_base: str | None = None
    concurrency: int = 20
    requests_per_minute: float | None = None
    timeout_s: float = 600.0
    retries: int = 4
    max_output_tokens: int | None = None
    max_cost_usd: float | None = None
    max_tokens_total: int | None = None
    cache: bool = False
    cache_dir: str | None = None

    def __post_init__(self) -> None:
        if not self.model:
            raise UsageError("vlm.model is empty; give a model as LiteLLM writes it, such as gemini/gemini-2.5-pro")
        check_positive("vlm.", concurrency=self.concurrency, timeout_s=self.timeout_s)
        for name in ("requests_per_minute", "max_output_tokens", "max_cost_usd", "max_tokens_total"):
            if getattr(self, name) is not None:
                check_positive("vlm.", **{name: getattr(self, name)})
        if self.retries < 0:
            raise UsageError(f"vlm.retries must be at least 0, got {self.retries}")
        self._client = Client(self.model, self.api_base, self.timeout_s, self.max_output_tokens)
        if self.max_cost_usd is not None and not self._client.priced:
            raise UserError(
                f"vlm.max_cost_usd can't be kept: LiteLLM's price list has no price for {self.model}; "
                "use vlm.max_tokens_total"
            )
        self._pace = Pace(self.requests_per_minute)
        self._spending = Spending(self.max_cost_usd, self.max_tokens_total)
        self._answered: set[str] = set()  # ids of requests, in this process
        asked = {"model": self.model, "api_base": self.api_base, "max_output_tokens": self.max_output_tokens}
        self._cache = Cache(self.cache_dir, asked) if self.cache else None

    @classmethod
    def estimate(cls, request: Request, model: str) -> Estimate:
        return estimate(request, model)

    @hookimpl
    def reply_received(self, request: Request, reply: Reply) -> None:
        """What a run had spent before it was resumed counts against its limits."""
        if self._spending.limited and request.id not in self._answered and _was_paid(reply):
            tokens = reply.prompt_tokens, reply.completion_tokens
            answer = Answer(reply.text, reply.model, "", *tokens, reply.cost_usd)
            self._spending.add(*self._client.spent(request, answer))

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`. When the caller stops listening, calls that have not begun are dropped.

        Calls that are under way when a limit is reached are waited for.
        """
        waiting: queue.SimpleQueue[Request] = queue.SimpleQueue()
        for request in requests:
            waiting.put(request)
        results: queue.SimpleQueue[Reply | LimitReached] = queue.SimpleQueue()
        stop = threading.Event()

        def work() -> None:
            while not stop.is_set():
                try:
                    request = waiting.get_nowait()
                except queue.Empty:
                    return
                result: Reply | LimitReached
                try:
                    result = self._kept(request) or self._answer(request, stop)
                except LimitReached as limit:
                    result = limit
                except Exception as error:  # or the caller would wait for ever
                    result = Reply(request.id, "", self.model, error=explain(error))
                results.put(result)

        for number in range(min(self.concurrency, len(requests))):
            # Daemons, so that an interrupted process ends without waiting for a server.
            threading.Thread(target=work, name=f"{self.model} {number}", daemon=True).start()
        limits: list[LimitReached] = []
        try:
            for _ in requests:
                result = results.get()
                if isinstance(result, LimitReached):
                    limits.append(result)
                else:
                    self._answered.add(result.request_id)
                    yield result
        finally:
            stop.set()
        if limits:
            raise LimitReached(f"{limits[0]}; {len(limits)} of {len(requests)} requests are left without a reply")

    def _kept(self, request: Request) -> Reply | None:
        return self._cache.get(request) if self._cache is not None else None

    def _answer(self, request: Request, stop: threading.Event) -> Reply:
        """The reply, after as many tries as it takes and is allowed.

        Raises:
            LimitReached: nothing may be spent any more.
        """
        tries = 0
        while True:
            self._pace.wait(stop)
            if stop.is_set():
                return Reply(request.id, "", self.model, error="interrupted")
            reached = self._spending.reached()
            if reached is not None:
                raise LimitReached(reached)
            tries += 1
            try:
                answer = within(self.timeout_s, lambda: self._client.ask(request))
            except Exception as error:  # whatever a server or LiteLLM comes up with costs this reply only
                wait_s = pause(error, tries)
                if tries > self.retries or wait_s is None:
                    after = f" (after {tries} tries)" if tries > 1 else ""
                    return Reply(request.id, "", self.model, error=explain(error) + after)
                stop.wait(wait_s)
            else:
                if self._spending.limited:
                    self._spending.add(*self._client.spent(request, answer))
                reply = self._reply(request, answer)
                if self._cache is not None and reply.error is None:
                    self._cache.put(request, reply)
                return reply

    def _reply(self, request: Request, answer: Answer) -> Reply:
        """What came, judged by why the model stopped. A text that was cut off is passed on as far as it goes."""
        error = None
        if answer.finish == "content_filter":
            error = "the provider's safety filter blocked the reply"
        elif answer.finish == "length" and not answer.text.strip():
            error = "the length limit was reached before any text came; raise vlm.max_output_tokens"
        elif answer.finish == "length":
            _log.warning(
                "%s: the length limit cut off the reply to %s; see vlm.max_output_tokens", self.model, request.id
            )
        elif not answer.text.strip():
            error = f"the reply is empty (finish reason: {answer.finish})"
        return Reply(
            request.id,
            answer.text,
            answer.model,
            error,
            prompt_tokens=answer.prompt_tokens,
            completion_tokens=answer.completion_tokens,
            cost_usd=answer.cost_usd,
        )


def _was_paid(reply: Reply) -> bool:
    """No cache had it, and the call came through."""
    return reply.cost_usd != 0.0 and (reply.error is None or reply.prompt_tokens is not None)


@dataclass(eq=False)
class Gemini(LanguageModel):
    model: str = "gemini/gemini-2.5-pro"


@dataclass(eq=False)
class OpenAI(LanguageModel):
    model: str = "openai/gpt-5.4"


@dataclass(eq=False)
class Anthropic(LanguageModel):
    model: str = "anthropic/claude-sonnet-4-6"


@dataclass(eq=False)
class Ollama(LanguageModel):
    """On this machine, hence few at once and slow."""

    model: str = "ollama_chat/qwen3-vl:8b"
    concurrency: int = 2
    timeout_s: float = 1800.0


class Pace:
    """Spaces calls evenly, ``per_minute`` of them (None: no spacing), whichever thread makes them."""

    def __init__(self, per_minute: float | None) -> None:
        self._gap_s = 60.0 / per_minute if per_minute is not None else 0.0
        self._free_at = 0.0  # when the next call may begin, on the monotonic clock
        self._lock = threading.Lock()

    def wait(self, stop: threading.Event) -> None:
        """Until it is the caller's turn, or ``stop`` is set."""
        with self._lock:
            begin = max(time.monotonic(), self._free_at)
            self._free_at = begin + self._gap_s
        stop.wait(max(0.0, begin - time.monotonic()))
