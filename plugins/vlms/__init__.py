"""What answers requests. Modules are imported when a model is made: LiteLLM alone takes seconds."""

from collections.abc import Mapping

from core.hooks import hookimpl

LITELLM = {
    "gemini": "Gemini",
    "openai": "OpenAI",
    "anthropic": "Anthropic",
    "ollama": "Ollama",
    "litellm": "LanguageModel",
}


@hookimpl
def vlms() -> Mapping[str, str]:
    return {
        "offline": "plugins.vlms.offline.designer:OfflineDesigner",
        **{
            name: f"plugins.vlms.litellm.language_model:{cls}"
            for name, cls in LITELLM.items()
        },
        "replay": "plugins.vlms.replay:PastReplies",
        "mailbox": "plugins.vlms.mailbox:Mailbox",
        "command": "plugins.vlms.command:Command",
        "ensemble": "plugins.vlms.ensemble:Ensemble",
    }


@hookimpl
def prompt_values() -> Mapping[str, str]:
    return {
        "arm": "plugins.vlms.context.arm_facts:arm_value",
        "urdf": "plugins.vlms.context.outline:urdf_value",
        "elites": "plugins.vlms.context.elites:elites_value",
        "critiques": "plugins.vlms.context.elites:critiques_value",
        "measured": "plugins.vlms.context.elites:measured_value",
        "candidates": "plugins.vlms.context.feedback:candidates_value",
        "ledger": "plugins.vlms.context.ledger:ledger_value",
        "examples": "plugins.vlms.context.examples:examples_value",
        "lessons": "plugins.vlms.context.lessons:lessons_value",
        "hard_layouts": "plugins.vlms.context.hard_layouts:hard_layouts_value",
    }


@hookimpl
def critics() -> Mapping[str, str]:
    return {"model": "plugins.vlms.critic:ModelCritic"}


@hookimpl
def artists() -> Mapping[str, str]:
    return {"engine": "plugins.vlms.artist:EngineArtist"}


@hookimpl
def memories() -> Mapping[str, str]:
    return {"model": "plugins.vlms.recalling:ModelMemory"}


@hookimpl
def menders() -> Mapping[str, str]:
    return {"second_look": "plugins.vlms.second_look:SecondLook"}


@hookimpl
def levels() -> Mapping[str, str]:
    names = {"source": "Source", "words": "Words", "pictures": "Pictures"}
    return {name: f"plugins.vlms.context.levels:{cls}" for name, cls in names.items()}
