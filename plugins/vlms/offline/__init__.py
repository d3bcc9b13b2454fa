"""The embedded designer: answers requests without a language model."""
