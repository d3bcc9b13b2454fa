"""Write the weights of a GGUF file in transformers' own form: ``python convert.py FILE FOLDER``.

``transformers serve`` can't serve such a local file, and what is loaded from one can't be saved as it is.
"""

import sys
from pathlib import Path

from transformers import AutoModelForCausalLM, AutoTokenizer, LlamaForCausalLM

weights = Path(sys.argv[1])
loaded = AutoModelForCausalLM.from_pretrained(weights.parent, gguf_file=weights.name)
config = loaded.config
del config.quantization_config
config.architectures = ["LlamaForCausalLM"]

plain = LlamaForCausalLM(config)
plain.load_state_dict(loaded.state_dict())
plain.save_pretrained(sys.argv[2])

tokenizer = AutoTokenizer.from_pretrained(weights.parent, gguf_file=weights.name)
tokenizer.save_pretrained(sys.argv[2])
