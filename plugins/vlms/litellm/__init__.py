"""Language models through LiteLLM."""
