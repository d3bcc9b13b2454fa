"""Make one call through LiteLLM: settings, request, answer. `LanguageModel` repeats and limits calls."""

from __future__ import annotations

import importlib
import logging
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import httpx

from core.errors import LimitReached, UsageError, UserError
from core.interfaces import Reply, Request
from core.support.text import clean, kind
from core.values.messages import checked
from plugins.vlms.litellm.call_settings import CallSettings, check_options
from plugins.vlms.litellm.context import OllamaContext, find_miscount
from plugins.vlms.litellm.failures import explain, find_words, refuses
from plugins.vlms.litellm.hearing import Hearing
from plugins.vlms.litellm.loading import load
from plugins.vlms.litellm.manner import Form, Manner, weaken
from plugins.vlms.litellm.prices import count_cached, find_prices, saved
from plugins.vlms.litellm.room import explain_room, is_too_long
from plugins.vlms.litellm.transport import (
    OPENAI,
    BadAnswer,
    Call,
    EmptyStream,
    OtherForm,
    Unreadable,
    calling,
)
from plugins.vlms.litellm.unwrapping import find_text
from plugins.vlms.litellm.wire_messages import (
    draw_on_sheets,
    explain_schema,
    render,
    without_pictures,
)

_log = logging.getLogger(__name__)

# Servers on the user's machines: they enforce a schema with any model, and their answers have no price.
_LOCAL = ("ollama", "ollama_chat", "hosted_vllm", "lm_studio", "llamafile")

# What LiteLLM takes in place of a key ending in _API_KEY.
_OTHER_KEYS = {
    "anthropic": ("ANTHROPIC_AUTH_TOKEN",),
    "azure": ("AZURE_AD_TOKEN", "AZURE_OPENAI_API_KEY"),
    "huggingface": ("HF_TOKEN",),
    "replicate": ("REPLICATE_API_TOKEN",),
}

_LIKE_OPENAI = ("aiohttp_openai", "custom_openai")  # beside those that LiteLLM lists
# Names of keys that do not follow from the provider's.
_UNUSUAL = {
    "cometapi": "COMETAPI_KEY",
    "lambda_ai": "LAMBDA_API_KEY",
    "meta_llama": "LLAMA_API_KEY",
}


class Client:
    """Calls ``model``; see `LanguageModel` for the settings.

    Attributes:
        model: in LiteLLM's notation.
        prices: of its tokens; None: they are unknown.
        sees: it takes pictures, as far as is known before it is asked.

    Raises:
        UserError: LiteLLM does not know the provider, refuses the model, or finds no API key; or the address is none.
    """

    def __init__(
        self, model: str, api_base: str | None, settings: CallSettings
    ) -> None:
        """Find the provider, its key, and what it accepts.

        Args:
            model: in LiteLLM's notation.
            api_base: address of the server; None: the provider's own.
            settings: of each call.
        """
        self._litellm = load()
        self._server = None if api_base is None else _server(api_base)
        try:
            self._bare, self._provider, key, _ = self._litellm.get_llm_provider(
                model, api_base=api_base
            )
        except self._litellm.BadRequestError as error:
            raise UserError(
                f"vlm.model={model}: LiteLLM knows no such provider; write provider/model, "
                "such as gemini/gemini-2.5-pro, or openai/NAME with vlm.api_base for a server that speaks OpenAI's API"
            ) from error

        self.model = model
        self._settings = settings
        check_options(settings.options or {})
        self._fixed: dict[str, Any] = {
            "timeout": settings.timeout_s,
            "num_retries": 0,
            "max_retries": 0,
        }
        if api_base is not None:
            self._fixed["api_base"] = api_base
        if key is None:
            self._find_key(api_base)

        self.prices = None
        if self._provider not in _LOCAL:
            self.prices = find_prices(self._litellm, model)

        self._is_claude = self._provider == "anthropic" or "claude" in self._bare
        # Local servers use a schema as a grammar alone; of other models nobody knows.
        is_known = self._litellm.supports_response_schema(model=model)
        self._shows_schema = is_known and self._provider not in _LOCAL
        self._manner = self._find_manner()
        self.sees = self._manner.pictures
        self._context = None
        if self._provider.startswith("ollama"):
            self._context = OllamaContext(self._bare, api_base)

        self._has_warned = False

    def _find_manner(self) -> Manner:
        """Find how to ask, by what LiteLLM knows of the model, and say what is left out."""
        model = self.model
        is_own = self._server is not None  # whose model LiteLLM may not know
        schemas = (
            self._shows_schema
            or self._provider in _LOCAL
            or (is_own and self._accepts(response_format={"type": "json_object"}))
        )
        thinking = self._settings.thinking is None or is_own
        thinking = thinking or self._accepts(reasoning_effort="low")
        manner = Manner(
            form="json_schema" if schemas else "text",
            seed=self._accepts(seed=1),
            temperature=self._accepts(temperature=0.7),
            thinking=thinking,
            pictures=is_own or self._has_eyes(),
            marks=self._is_claude
            and self._litellm.utils.supports_prompt_caching(model=model),
        )

        left_out = [
            name for name in ("temperature", "seed") if not getattr(manner, name)
        ]
        if manner.form == "text":
            left_out.append("JSON schema (the prompt's text holds it)")
        if self._settings.thinking is not None and not manner.thinking:
            left_out.append("vlm.thinking")
        if not manner.pictures:
            left_out.append("pictures (the prompt's text says so)")

        if left_out:
            names = ", no ".join(left_out)
            _log.warning("%s accepts no %s: left out of its requests", model, names)

        return manner

    def _has_eyes(self) -> bool:
        """Say if a model takes pictures; one that LiteLLM does not know may."""
        try:
            self._litellm.get_model_info(self.model)
        except (
            Exception
        ):  # a model that is not in the list; the class of the error varies
            return True

        return bool(self._litellm.supports_vision(model=self.model))

    def _find_key(self, api_base: str | None) -> None:
        """Look for an API key in the environment; a server at an address of one's own may need none.

        Raises:
            UserError: there is none, and the provider needs one.
        """
        missing = self._missing_keys()
        if not missing:
            return

        if api_base is None:
            names = " or ".join(missing)
            raise UserError(
                f"vlm.model={self.model} needs an API key; set the environment variable {names}"
            )

        # clients refuse to call without a key, local servers ignore it
        self._fixed["api_key"] = "none"

    def spent(self, request: Request, reply: Reply) -> tuple[int, float]:
        """Return tokens and US dollars of a call, as the reply reports them, or counted; 0 dollars without a price.

        Args:
            request: that was sent.
            reply: to the request.
        """
        prompt = reply.prompt_tokens
        if prompt is None:
            prompt = self._count(request)

        completion = reply.completion_tokens
        if completion is None:
            counter = self._litellm.token_counter
            completion = int(counter(model=self.model, text=reply.text))

        cost = reply.cost_usd
        if cost is None:
            cost = 0.0
            if self.prices is not None:
                cost = prompt * self.prices.prompt + completion * self.prices.answer

        return prompt + completion, cost

    def _count(self, request: Request) -> int:
        """Count the tokens of a request."""
        messages = render(explain_schema(request))
        return int(self._litellm.token_counter(model=self.model, messages=messages))

    def _missing_keys(self) -> list[str]:
        """The environment variables of which one must hold the key; empty: one does, or no key is needed."""
        if self._provider in _LOCAL:
            return []

        # Other credentials (AWS, Google Cloud) may be in files that only the provider's own library reads.
        missing = self._litellm.validate_environment(self.model)["missing_keys"]
        missing = sorted(name for name in missing if name.endswith("_API_KEY"))
        if not missing and self._provider not in OPENAI:
            missing = self._openai_like_keys()

        others = _OTHER_KEYS.get(self._provider, ())
        is_given = any(os.environ.get(name) for name in (*missing, *others))
        # of Azure, LiteLLM names the key if only the address is missing
        return [] if is_given else missing

    def _openai_like_keys(self) -> list[str]:
        """Name the key of a provider that speaks OpenAI's protocol; LiteLLM would send OpenAI's key in its place."""
        loader = importlib.import_module("litellm.llms.openai_like.json_loader")
        registered = loader.JSONProviderRegistry.get(self._provider)
        if registered is not None:
            return [registered.api_key_env]

        if self._provider not in (
            *self._litellm.openai_compatible_providers,
            *_LIKE_OPENAI,
        ):
            return []

        usual = f"{self._provider.upper().replace('-', '_')}_API_KEY"
        return [_UNUSUAL.get(self._provider, usual)]

    def _accepts(self, **parameter: Any) -> bool:
        """Report whether the provider's models take a parameter, as LiteLLM has it.

        Raises:
            UserError: LiteLLM refuses the model.
        """
        parameter |= {
            "model": self._bare,
            "custom_llm_provider": self._provider,
            "drop_params": False,
        }

        try:
            self._litellm.utils.get_optional_params(**parameter)
        except self._litellm.UnsupportedParamsError:
            return False
        except Exception as error:  # a provider's own check of the model's name; the class of the error varies
            raise UserError(
                f"vlm.model={self.model}: LiteLLM refuses it: {explain(error)}"
            ) from error

        return True

    def ask(self, request: Request, hearing: Hearing) -> tuple[Reply, str]:
        """Make one call; return the reply, and why the model stopped ("stop", "length", "content_filter"...).

        What the server refuses by name is left out, or said in a weaker way, from then on.

        Args:
            request: that is sent.
            hearing: which hears the answer.

        Raises:
            Exception: any error of LiteLLM's.
        """
        while True:
            manner = self._manner
            if request.needs_pictures and not manner.pictures:
                raise LimitReached(
                    f"{self.model} takes no pictures, and nothing else tells where things are: "
                    "ask a model that sees, or type prompt.context=source"
                )

            try:
                return self._call(request, manner, hearing)
            except Exception as error:
                if hearing.chunks or not self._weaken(manner, error):
                    raise

    def _weaken(self, manner: Manner, error: Exception) -> bool:
        """Ask in a weaker manner from now on, if a server's words name what it refuses; False: they name nothing.

        Args:
            manner: of the request that was refused.
            error: of the call.
        """
        words = find_words(error)
        if not refuses(error) or is_too_long(words):
            return False

        weaker = weaken(manner, words)
        if weaker is None:
            return False

        if self._manner is manner:  # no other request was refused meanwhile
            self._manner = weaker[0]
            said = clean(explain(error), 200)
            _log.warning("%s takes %s (it says: %s)", self.model, weaker[1], said)

        return True

    def _call(
        self, request: Request, manner: Manner, hearing: Hearing
    ) -> tuple[Reply, str]:
        """Make a call in a certain manner."""
        settings = self._settings_for(request, manner)

        form = settings.get("response_format", {}).get("type")
        sees_schema = self._shows_schema and form == "json_schema"
        messages = request.messages if sees_schema else explain_schema(request)
        if not manner.pictures:
            messages = without_pictures(messages)
        elif manner.sheets:
            messages = draw_on_sheets(messages, manner.sheets)

        rendered = render(messages, manner.marks)
        call = Call(self._provider, self._server, manner.stream, hearing.life)
        again: Call | None = None
        try:
            response = self._complete(rendered, settings, call, hearing)
        except OtherForm as other:
            kept = other.answer
            again = replace(call, streams=kept.streamed, kept=kept)
        except EmptyStream:
            again = replace(call, streams=False)

        if again is not None:
            if not again.streams:
                settings.pop("stream_options", None)
            response = self._complete(rendered, settings, again, hearing)

        return self._read(request, response, hearing)

    def _settings_for(self, request: Request, manner: Manner) -> dict[str, Any]:
        """Return what LiteLLM is given for a request beside its messages."""
        settings = dict(self._fixed)
        temperature = self._settings.temperature
        if temperature is None:
            temperature = request.temperature

        thinks = self._settings.thinking not in (None, "none")
        if manner.temperature and not (self._is_claude and thinks):
            most = 1.0 if self._is_claude else 2.0
            settings["temperature"] = min(temperature, most)
        if manner.seed:
            settings["seed"] = request.brief.seed
        if self._settings.max_output_tokens is not None and manner.length:
            settings[manner.length] = self._settings.max_output_tokens
        if request.asks_designs and manner.form != "text":
            settings["response_format"] = self._write_form(manner.form, request)
        if self._settings.thinking is not None and manner.thinking:
            settings["reasoning_effort"] = self._settings.thinking

        options = self._settings.options or {}
        allowed = [*options]
        if self._server is not None and "reasoning_effort" in settings:
            allowed.append("reasoning_effort")
        if allowed:
            settings["allowed_openai_params"] = allowed

        if self._context is not None:
            limit = self._settings.max_output_tokens
            settings["num_ctx"] = self._context.fit(request, limit)

        if manner.stream and manner.usage:
            settings["stream_options"] = {"include_usage": True}

        return settings | dict(options)

    def _write_form(self, form: Form, request: Request) -> dict[str, Any]:
        """Write the setting that holds an answer to its form."""
        if form == "json_schema":
            schema = {"name": "designs", "schema": request.schema, "strict": True}
            return {"type": "json_schema", "json_schema": schema}

        if not self._shows_schema:
            # which some servers make a grammar of, and the others leave alone
            return {"type": "json_object", "schema": request.schema}

        return {"type": "json_object"}

    def _complete(
        self,
        messages: list[dict[str, Any]],
        settings: Mapping[str, Any],
        call: Call,
        hearing: Hearing,
    ) -> Any:
        """Call LiteLLM, and return the whole answer.

        Args:
            messages: in LiteLLM's form.
            settings: of this call.
            call: that passes our transport.
            hearing: which hears a stream.
        """
        streamed = call.streams
        with calling(call):
            answer = self._litellm.completion(
                model=self.model,
                messages=messages,
                drop_params=True,
                stream=streamed,
                **settings,
            )
            return hearing.gather(self._litellm, answer) if streamed else answer

    def salvage(self, request: Request, hearing: Hearing) -> Reply | None:
        """Return what came of an answer that broke off; None: nothing did.

        Args:
            request: that was sent.
            hearing: which heard the answer.
        """
        if not hearing.characters:
            return None

        reply, _ = self._read(request, hearing.build(self._litellm), hearing)
        return reply if reply.text.strip() else None

    def _read(
        self, request: Request, response: Any, hearing: Hearing
    ) -> tuple[Reply, str]:
        """Read a whole answer; return it as a reply, and why the model stopped."""
        choices = getattr(response, "choices", None) or [None]
        choice = choices[0]
        message = getattr(choice, "message", None)
        text = getattr(message, "content", None) or ""

        if not isinstance(text, str):
            raise BadAnswer(f"the answer's text is {kind(text)}")
        if message is not None and hearing.chunks:
            text = find_text(message.model_dump())

        refusal = _refusal(message)
        is_reported = not hearing.chunks or hearing.reports_tokens()
        usage = getattr(response, "usage", None) if is_reported else None
        cached, kept = count_cached(usage)
        saving = None
        if self.prices is not None and (cached or kept):
            saving = saved(self.prices, cached or 0, kept)
        reply = Reply(
            request.id,
            text,
            str(getattr(response, "model", None) or self.model),
            prompt_tokens=getattr(usage, "prompt_tokens", None) or None,
            completion_tokens=getattr(usage, "completion_tokens", None) or None,
            cached_tokens=cached,
            cost_usd=self._cost(response),
            saved_usd=saving,
            error=f"the model refuses: {refusal}" if refusal and not text else None,
        )
        warning = find_miscount(request, reply.prompt_tokens)
        if warning and not self._has_warned:
            self._has_warned = True
            _log.warning("%s: %s", self.model, warning)

        finish = str(getattr(choice, "finish_reason", None) or "none given")
        return checked(reply), clean(finish, 40)

    def _cost(self, response: Any) -> float | None:
        """US dollars, by LiteLLM's price list, which has 0 for an unknown price; None: unknown."""
        if self._provider in _LOCAL:
            return None

        try:
            cost = self._litellm.completion_cost(
                completion_response=response, model=self.model
            )
            return float(cost) or None
        # a model that is not in the list; the class of the error varies
        except Exception:
            return None

    def explain(self, request: Request, error: Exception) -> str:
        """Say in one line why a call failed, and what helps.

        Args:
            request: that was sent.
            error: of the call.
        """
        words = find_words(error)
        if is_too_long(words):
            limit = self._settings.max_output_tokens
            return explain_room(words, self._count(request), limit)

        return explain(error) + self._hint(error)

    def _hint(self, error: Exception) -> str:
        """Return what may be wrong with an address that answers, but not as a model's server; empty: nothing."""
        status = getattr(error, "status_code", 0)
        lost = isinstance(error, Unreadable) or status in (404, 405)
        server = self._server
        if server is None or not lost or self._provider.startswith("ollama"):
            return ""
        if "/v1" in server.path:
            return ""

        return "; vlm.api_base has no /v1 at its end, which most servers want: http://HOST:PORT/v1"


def _server(address: str) -> httpx.URL:
    """Read the address of a server.

    Raises:
        UsageError: it is none.
    """
    try:
        url = httpx.URL(address)
    except httpx.InvalidURL:
        url = httpx.URL()

    is_host = url.host and "%" not in url.host  # what no host has is escaped
    if url.scheme in ("http", "https") and is_host:
        return url

    raise UsageError(
        f"vlm.api_base={clean(address, 200)} is no address; write it as http://HOST:PORT/v1"
    )


def _refusal(message: object) -> str:
    """Return the words of a model that refuses to answer; empty: it does not."""
    others = getattr(message, "provider_specific_fields", None) or {}
    words = getattr(message, "refusal", None) or others.get("refusal")
    return words if isinstance(words, str) else ""
