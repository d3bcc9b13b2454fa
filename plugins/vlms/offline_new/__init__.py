"""The embedded designer."""
