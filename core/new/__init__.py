"""Write plugin packages to start from: ``python -m core.new``."""
