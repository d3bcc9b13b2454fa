"""Language models through LiteLLM, which is imported only when a model is created, because that takes seconds."""

from collections.abc import Mapping

from core.hooks import hookimpl

_NAMES = {
    "gemini": "Gemini",
    "openai": "OpenAI",
    "anthropic": "Anthropic",
    "ollama": "Ollama",
    "litellm": "LanguageModel",
}


@hookimpl
def vlms() -> Mapping[str, str]:
    return {name: f"plugins.vlms.litellm.model:{cls}" for name, cls in _NAMES.items()}
