"""Whole runs with real servers and a real, small language model: `make real-model`, see CONTRIBUTING.md."""
