"""A language model behind an API: sends requests in parallel, within limits, and retries failed calls."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from core.design import DesignError
from core.designs.reading import list_designs
from core.designs.replies import parse_reply
from core.errors import LimitReached, UsageError, UserError, check_positive
from core.hooks import Harmless, Names, hookimpl
from core.interfaces import VLM, Estimate, Reply, Request, Spending
from plugins.vlms.calls import Arrivals, Calls
from plugins.vlms.litellm.call_settings import check_call_settings
from plugins.vlms.litellm.client import Client
from plugins.vlms.litellm.failures import pause, unanswered
from plugins.vlms.litellm.hearing import Hearing
from plugins.vlms.litellm.prices import estimate
from plugins.vlms.prompt_files import take_shared

_log = logging.getLogger(__name__)

KEPT_S = 240.0  # so long providers keep a prompt's beginning at least; Anthropic says 5 minutes

Paid = Annotated[str, Names("model that is paid")]


@dataclass(eq=False)
class LanguageModel(VLM):
    """Asks a model through LiteLLM.

    Args:
        model: in LiteLLM's notation, ``provider/model``.
        api_base: address of the server; None: the provider's own.
        concurrency: calls that may wait for an answer at the same time.
        requests_per_minute: calls that may begin in a minute, evenly spaced; None: no limit.
        timeout_s: a call is abandoned when its server is silent for so long, or after ten times as long.
        max_output_tokens: of an answer, thinking included; None: the provider's maximum.
        thinking: how much the model thinks before it answers, ``none``, ``low``, ``medium`` or ``high``; None: as the
            provider has it.
        temperature: of all calls; None: each agent's own, as ``sampling`` says.
        options: what LiteLLM passes on beside all this, by name; they are stored with the run.
        max_cost_usd: no further call is made once calls have cost this much; None: no limit.
        max_tokens_total: no further call is made once prompts and answers together have this many tokens; None: no
            limit.

    Raises:
        UserError: LiteLLM does not know the provider, or finds no API key; a cost limit without a known price.
    """

    takes_schema = True
    repairs = True

    model: Paid = ""
    api_base: Annotated[str | None, Names("host")] = None
    concurrency: int = 20
    requests_per_minute: float | None = None
    timeout_s: float = 600.0
    max_output_tokens: int | None = None
    thinking: Harmless[str | None] = None
    temperature: float | None = None
    options: Annotated[dict[str, Any] | None, Names("host")] = None
    max_cost_usd: float | None = None
    max_tokens_total: int | None = None

    def __post_init__(self) -> None:
        if not self.model:
            raise UsageError(
                "vlm.model is empty; give provider/model, such as vlm.model=gemini/gemini-2.5-pro"
            )

        check_positive(
            "vlm.",
            concurrency=self.concurrency,
            requests_per_minute=self.requests_per_minute,
            max_cost_usd=self.max_cost_usd,
            max_tokens_total=self.max_tokens_total,
        )
        check_call_settings(self)
        self._client = Client(self.model, self.api_base, self)
        self.sees = self._client.sees
        self._arrivals = Arrivals(self.model)
        self._kept_at = -math.inf  # when an answer last began, monotonic
        self._calls = Calls(self.model, self.concurrency, self._answer, self._failed)
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
        if limits.max_cost_usd is not None and self._client.prices is None:
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
        """See `VLM.complete`, and `Calls.replies`.

        Where a provider keeps the beginning of prompts that it has seen, the first request goes ahead of the others.
        """
        leads = self._leads(requests)
        for reply in self._calls.replies(requests, first=leads):
            self._answered.add(reply.request_id)
            yield reply

    def _leads(self, requests: Sequence[Request]) -> bool:
        """Say if the first request goes ahead, so that the provider keeps what the others share with it."""
        prices = self._client.prices
        if prices is None or not prices.caches or not requests:
            return False

        is_kept = time.monotonic() < self._kept_at + KEPT_S
        return bool(take_shared(requests[0].messages)) and not is_kept

    def _answer(self, request: Request, stop: threading.Event) -> Reply:
        """Call the model until a call succeeds, or another one would not.

        Args:
            request: that is sent.
            stop: set when nobody waits for the reply any more.

        Raises:
            LimitReached: a limit of cost or tokens is reached.
        """
        tries = 0
        try:
            while True:
                self._pace.wait(stop)
                if stop.is_set():
                    return Reply(request.id, "", self.model, error="interrupted")

                for limits in self._limits:
                    reached = limits.reached()
                    if reached:
                        raise LimitReached(reached)

                tries += 1
                reply = self._try(request, tries, stop)
                if reply is not None:
                    return reply
        finally:
            self._arrivals.end(request.id)

    def _try(self, request: Request, tries: int, stop: threading.Event) -> Reply | None:
        """Call the model once; None: it is to be called again, after a wait.

        Args:
            request: that is sent.
            tries: calls so far, with this one.
            stop: see `_answer`.
        """
        hearing = Hearing(self.timeout_s, lambda count: self._hear(request, count))
        try:
            reply, finish = self._client.ask(request, hearing)
        except LimitReached:
            raise
        # any error of a server or of LiteLLM costs this reply only
        except Exception as error:
            kept = self._keep(request, hearing, error)
            if kept is not None:
                return kept

            wait_s = pause(error, tries)
            if wait_s is None:
                after = f" (after {tries} tries)" if tries > 1 else ""
                return self._failed(request, error, after)

            stop.wait(wait_s)
            return None

        self._spend(request, reply)
        return self._explain_empty(reply, finish)

    def _hear(self, request: Request, characters: int) -> None:
        """Note that more of an answer has arrived."""
        self._kept_at = time.monotonic()
        self._calls.lead()
        self._arrivals.hear(request.id, characters)

    def _keep(
        self, request: Request, hearing: Hearing, error: Exception
    ) -> Reply | None:
        """Return what came of an answer that broke off, if it is of use; what came of it counts towards the limits.

        Args:
            request: that was sent.
            hearing: which heard the answer.
            error: that ended it.
        """
        reply = self._client.salvage(request, hearing)
        if reply is None:
            return None

        self._spend(request, reply)
        if not _holds_designs(request, reply.text):
            return None

        _log.warning(
            "%s: the reply to %s broke off after %s characters, which are kept: %s",
            self.model,
            request.id,
            f"{len(reply.text):,}",
            self._client.explain(request, error),
        )
        return reply

    def _failed(self, request: Request, error: Exception, after: str = "") -> Reply:
        """Make the reply of a call that failed; ``after`` says after how many tries."""
        return Reply(
            request.id,
            "",
            self.model,
            error=self._client.explain(request, error) + after,
            unanswered=unanswered(error),
        )

    def _limit_in_words(self) -> str:
        """Name the limit that cuts answers off."""
        limit = self.max_output_tokens
        if limit is None:
            return (
                "the provider's own limit of length; vlm.max_output_tokens sets another"
            )

        return f"vlm.max_output_tokens={limit}"

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
            return replace(reply, cut_by=self._limit_in_words())
        elif not reply.text.strip():
            error = f"the reply is empty (finish reason: {finish})"

        return replace(reply, error=error)


def _holds_designs(request: Request, text: str) -> bool:
    """Say if a text that may have broken off holds something to try; a critique needs no more than words."""
    if not request.asks_designs:
        return bool(text.strip())

    try:
        return bool(list_designs(parse_reply(text)))
    except DesignError:
        return False


@dataclass(eq=False)
class Gemini(LanguageModel):
    """Google's models, with a key in ``GEMINI_API_KEY``."""

    model: Paid = "gemini/gemini-2.5-pro"


@dataclass(eq=False)
class OpenAI(LanguageModel):
    """OpenAI's models, with a key in ``OPENAI_API_KEY``."""

    model: Paid = "openai/gpt-5.4"


@dataclass(eq=False)
class Anthropic(LanguageModel):
    """Anthropic's models, with a key in ``ANTHROPIC_API_KEY``."""

    model: Paid = "anthropic/claude-sonnet-4-6"


@dataclass(eq=False)
class Ollama(LanguageModel):
    """A model on the user's own machine, which is slow and answers few requests in parallel."""

    model: Paid = "ollama_chat/qwen3-vl:8b"
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
