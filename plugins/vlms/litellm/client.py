"""Make one call through LiteLLM: settings, request, answer. Retries and limits are in `plugins.vlms.litellm.model`."""

from __future__ import annotations

import base64
import importlib
import importlib.metadata
import json
import logging
import math
import os
import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import httpx

from core.errors import UsageError, UserError
from core.interfaces import Estimate, Message, Picture, Reply, Request, Text
from core.support.secrets import is_secret_name
from core.support.text import clean, kind
from core.values.messages import checked
from plugins.vlms.litellm.failures import explain
from plugins.vlms.litellm.transport import OPENAI, BadAnswer, calling, transport

_log = logging.getLogger(__name__)

PIXELS_PER_TOKEN = 750  # https://docs.claude.com/en/docs/vision

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

# Read by LiteLLM when it is imported: its tables come from the package, not from the network, and no .env file is read.
_AT_IMPORT = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",
    "LITELLM_LOCAL_ANTHROPIC_BETA_HEADERS": "True",
    "LITELLM_MODE": "PRODUCTION",
    "LITELLM_DISABLE_REDACT_SECRETS": "true",  # ours scrubs more, and takes no minutes for a long error
}


def load() -> ModuleType:
    """Import LiteLLM, which takes seconds, and keep it from printing and from fetching anything but answers."""
    os.environ.update(_AT_IMPORT)

    for name, value in os.environ.items():
        # a file's last line break, which no header can hold
        if is_secret_name(name) and value != value.strip():
            os.environ[name] = value.strip()

    try:
        litellm = importlib.import_module("litellm")
    except ModuleNotFoundError as error:
        raise UserError(
            "a model behind an API needs LiteLLM: pip install 'litellm>=1.106'"
        ) from error

    litellm.__dict__.update(
        suppress_debug_info=True, telemetry=False, disable_hf_tokenizer_download=True
    )
    if litellm.client_session is None:
        _guard(litellm)

    # these quote the answer
    warnings.filterwarnings("ignore", "Pydantic serializer", UserWarning)
    for logger in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
        logging.getLogger(logger).setLevel(logging.CRITICAL + 1)

    return litellm


def _guard(litellm: ModuleType) -> None:
    """Send all requests of LiteLLM's clients through our transport."""
    handlers = importlib.import_module("litellm.llms.custom_httpx.http_handler")
    guarded = transport(
        verify=handlers.get_ssl_configuration(), cert=os.getenv("SSL_CERTIFICATE")
    )
    client = httpx.Client(transport=guarded)
    litellm.__dict__.update(client_session=client, sync_transport=guarded)


def estimate(request: Request, model: str) -> Estimate:
    """Count tokens: texts with LiteLLM's counter, pictures by their pixels; prices are from LiteLLM's list.

    Args:
        request: which is not sent.
        model: in LiteLLM's notation.
    """
    litellm = load()
    texts = []
    tokens = 0

    for message in explained(request):
        pictures = [part for part in message.parts if isinstance(part, Picture)]
        parts = tuple(part for part in message.parts if isinstance(part, Text))
        tokens += sum(map(_picture_tokens, pictures))
        texts.append(replace(message, parts=parts))

    tokens += litellm.token_counter(model=model, messages=render(texts))

    counter = "litellm.token_counter"
    price = _price(litellm, model)
    if price is None:
        return Estimate(tokens, counter)

    version = importlib.metadata.version("litellm")
    return Estimate(tokens, counter, *price, f"price list of LiteLLM {version}")


def _picture_tokens(picture: Picture) -> int:
    """Count the tokens of a PNG picture as Claude does, a token for 750 pixels; other providers count otherwise."""
    header = picture.png[:24]
    width = int.from_bytes(header[16:20], "big")
    height = int.from_bytes(header[20:24], "big")
    return math.ceil(width * height / PIXELS_PER_TOKEN)


def _price(litellm: ModuleType, model: str) -> tuple[float, float] | None:
    """US dollars per token in and out; None: unknown.

    Args:
        litellm: the module.
        model: in LiteLLM's notation.
    """
    try:
        info = litellm.get_model_info(model)
    except Exception:  # a model that is not in the list; the class of the error varies
        return None

    prompt = info.get("input_cost_per_token")
    completion = info.get("output_cost_per_token")
    if not (prompt and completion):
        return None

    return float(prompt), float(completion)


class Client:
    """Calls ``model``; see `LanguageModel` for the settings.

    Raises:
        UserError: LiteLLM does not know the provider, refuses the model, or finds no API key; or the address is none.
    """

    def __init__(
        self,
        model: str,
        api_base: str | None,
        timeout_s: float,
        max_output_tokens: int | None,
    ) -> None:
        """Find the provider, its key, and what it accepts.

        Args:
            model: in LiteLLM's notation.
            api_base: address of the server; None: the provider's own.
            timeout_s: after which a call is abandoned.
            max_output_tokens: of an answer; None: the provider's maximum.
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
        self._settings: dict[str, Any] = {
            "timeout": timeout_s + 1.0,
            "num_retries": 0,
            "max_retries": 0,
        }
        if max_output_tokens is not None:
            self._settings["max_tokens"] = max_output_tokens
        if api_base is not None:
            self._settings["api_base"] = api_base
        if key is None:
            self._find_key(api_base)

        self._price = None
        if self._provider not in _LOCAL:
            self._price = _price(self._litellm, model)

        self.priced = self._price is not None
        self._schema_lock = threading.Lock()
        schemas = self._provider in _LOCAL or self._litellm.supports_response_schema(
            model=model
        )
        self._accepted = {
            "temperature": self._accepts(temperature=0.7),
            "seed": self._accepts(seed=1),
            "response_format": bool(schemas),
        }
        left_out = [name for name, accepted in self._accepted.items() if not accepted]

        if left_out:
            names = ", no ".join(left_out).replace(
                "response_format", "JSON schema (the prompt's text holds it)"
            )
            _log.warning("%s accepts no %s: left out of its requests", model, names)

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
        self._settings["api_key"] = "none"

    def spent(self, request: Request, reply: Reply) -> tuple[int, float]:
        """Return tokens and US dollars of a call, as the reply reports them, or counted; 0 dollars without a price.

        Args:
            request: that was sent.
            reply: to the request.
        """
        count = self._litellm.token_counter
        prompt = reply.prompt_tokens
        if prompt is None:
            messages = render(explained(request))
            prompt = int(count(model=self.model, messages=messages))

        completion = reply.completion_tokens
        if completion is None:
            completion = int(count(model=self.model, text=reply.text))

        cost = reply.cost_usd
        if cost is None:
            per_prompt_token, per_completion_token = self._price or (0.0, 0.0)
            cost = prompt * per_prompt_token + completion * per_completion_token

        return prompt + completion, cost

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

    def ask(self, request: Request) -> tuple[Reply, str]:
        """Make one call; return the reply, and why the model stopped ("stop", "length", "content_filter"...).

        A schema that the provider refuses is in the prompt's text from then on.

        Raises:
            Exception: any error of LiteLLM's.
        """
        with_schema = self._accepted["response_format"]

        try:
            return self._call(request, with_schema)
        except self._litellm.BadRequestError as error:
            words = ("schema", "response_format", "output_format", "too many states")
            if not (with_schema and any(word in str(error).lower() for word in words)):
                raise

        with self._schema_lock:
            if self._accepted["response_format"]:
                self._accepted["response_format"] = False
                _log.warning(
                    "%s refused the JSON schema of the answer: from now on in the prompt's text",
                    self.model,
                )

        return self._call(request, False)

    def _call(self, request: Request, with_schema: bool) -> tuple[Reply, str]:
        """Make a call, with the schema as a setting of it, or as text."""
        settings = dict(self._settings)
        if self._accepted["temperature"]:
            is_claude = self._provider == "anthropic" or "claude" in self._bare
            settings["temperature"] = min(
                request.temperature, 1.0 if is_claude else 2.0
            )

        if self._accepted["seed"]:
            settings["seed"] = request.brief.seed

        with_schema &= not request.critique
        if with_schema:
            schema = {"name": "designs", "schema": request.schema, "strict": True}
            settings["response_format"] = {"type": "json_schema", "json_schema": schema}

        # local servers use the schema as a grammar alone: the model does not see it
        sees_schema = with_schema and self._provider not in _LOCAL
        messages = render(request.messages if sees_schema else explained(request))
        response = self._complete(messages, settings)
        choice = response.choices[0] if response.choices else None
        message = getattr(choice, "message", None)
        text = getattr(message, "content", None) or ""

        if not isinstance(text, str):
            raise BadAnswer(f"the answer's text is {kind(text)}")

        refusal = _refusal(message)
        usage = getattr(response, "usage", None)
        reply = Reply(
            request.id,
            text,
            str(response.model or self.model),
            prompt_tokens=getattr(usage, "prompt_tokens", None) or None,
            completion_tokens=getattr(usage, "completion_tokens", None) or None,
            cost_usd=self._cost(response),
            error=f"the model refuses: {refusal}" if refusal and not text else None,
        )
        finish = str(getattr(choice, "finish_reason", None) or "none given")
        return checked(reply), clean(finish, 40)

    def _complete(
        self,
        messages: list[dict[str, Any]],
        settings: Mapping[str, Any],
    ) -> Any:
        """Call LiteLLM.

        Args:
            messages: in LiteLLM's form.
            settings: of this call.
        """
        with calling(self._provider, self._server):
            return self._litellm.completion(
                model=self.model, messages=messages, drop_params=True, **settings
            )

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


def explained(request: Request) -> tuple[Message, ...]:
    """The messages of a request, with the schema as text at the end, if it has one."""
    if request.critique:
        return request.messages

    schema = json.dumps(request.schema, ensure_ascii=False, separators=(",", ":"))
    text = Text(f"JSON schema of the answer:\n```json\n{schema}\n```\n")
    *before, last = request.messages
    return (*before, replace(last, parts=(*last.parts, text)))


def render(messages: Sequence[Message]) -> list[dict[str, Any]]:
    """Messages in LiteLLM's form: one text if there is no picture, otherwise parts; pictures are data URLs."""
    return [
        {"role": message.role, "content": _content(message)} for message in messages
    ]


def _content(message: Message) -> str | list[dict[str, Any]]:
    """Write a message's parts; a message without pictures is one text."""
    parts: list[dict[str, Any]] = []
    for part in message.parts:
        if isinstance(part, Picture):
            url = "data:image/png;base64," + base64.b64encode(part.png).decode()
            parts.append({"type": "image_url", "image_url": {"url": url}})
        else:
            parts.append({"type": "text", "text": part.text})

    if any(part["type"] != "text" for part in parts):
        return parts

    return "".join(part["text"] for part in parts)
