import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.schemas import EvaluateConfig, RunConfig
from core.errors import UsageError
from plugins.commands.prompt import PromptConfig

COMMANDS = {"config": RunConfig, "evaluate": EvaluateConfig, "prompt": PromptConfig}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_has_the_keys_of_its_schema(command):
    assert set(load(command, [], COMMANDS[command])) == set(
        OmegaConf.structured(COMMANDS[command])
    )


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (["seed=many"], "seed"),
        (["budget.n_agent=1.5"], "n_agent"),
        (["film=perhaps"], "film"),
    ],
)
def test_a_value_of_another_type_is_refused(words, key):
    with pytest.raises(UsageError, match=key):
        load("config", words)
