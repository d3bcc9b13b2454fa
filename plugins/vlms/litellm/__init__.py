"""Language models, reached through LiteLLM, which is imported when one is made, since that takes seconds."""

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
    return {name: f"plugins.vlms.litellm.model:{of}" for name, of in _NAMES.items()}
