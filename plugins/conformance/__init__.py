"""Check a plugin's part against what every part of its kind must do; each check is a plain function.

What steps engines is covered by `tests/plugins/simulators/test_conformance.py`, the rest by
`tests/plugins/conformance/`.
"""
