"""``vlmgineer study ladder``: climb levels of scenes until two in a row fail, and say how far a method gets."""
