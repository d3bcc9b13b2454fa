"""Import LiteLLM, and keep it from printing and from fetching anything but answers."""

from __future__ import annotations

import importlib
import logging
import os
import warnings
from types import ModuleType

import httpx

from core.errors import UserError
from core.support.secrets import is_secret_name
from plugins.vlms.litellm.transport import transport

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
        suppress_debug_info=True,
        telemetry=False,
        disable_hf_tokenizer_download=True,
        disable_streaming_logging=True,
        # a number may well stand a hundred times in an answer
        REPEATED_STREAMING_CHUNK_LIMIT=10**9,
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
