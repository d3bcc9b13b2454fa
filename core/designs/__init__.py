"""Read designs documents, check their rules, and compose the prompts that ask for them."""
