# The commands of a contributor. `make setup` comes first.
PYTHON = .venv/bin/python

.PHONY: setup check test site real-model cluster slicer mutants

setup:
	python3 -m venv .venv
	.venv/bin/pip install -q -e '.[dev]'

check:
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

test:
	$(PYTHON) -m pytest -n auto

# The same tests with another Python, in an environment of its own: make test-3.13
test-%:
	python$* -m venv .venv-$*
	.venv-$*/bin/pip install -q -e '.[test]'
	.venv-$*/bin/python -m pytest -n auto

site:
	NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build -q

# Real servers with a real, small model. The first time llama.cpp is built, and kept in a cache.
real-model:
	$(PYTHON) -m pytest -n 0 -s -m real tests/real_models

# Slurm and Ray with several nodes on this machine. As root it installs Slurm and Munge from Debian's packages.
cluster:
	$(PYTHON) -m pytest -n 0 -s -m cluster tests/cluster

# What printing takes, by a real slicer: apt-get install prusa-slicer
slicer:
	$(PYTHON) -m pytest -n 0 -s -m slicer tests/plugins/results/workshop

# Random faults in core and plugins, of which the tests should see nearly all: make mutants count=20 room=core/store
count = 20
seed = 0
room = core,plugins
mutants:
	$(PYTHON) -m tests.benchmarks.mutants count=$(count) seed=$(seed) room=$(room)
