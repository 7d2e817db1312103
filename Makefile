# make test        set up and pass all tests
# make recordings  score the embedded agent over a folder of recorded hosts: make recordings DIR=...
# make bench       print the measurements of bench/
# make lock        renew the lock files of .ci/ from pyproject.toml

PYTHON := .venv/bin/python

.PHONY: setup test lint recordings bench lock

setup:
	@.ci/setup dev

lint: setup
	@.venv/bin/ruff format --check .
	@.venv/bin/ruff check .
	@.venv/bin/mypy
	@.venv/bin/lint-imports

test: lint
	@$(PYTHON) -m pytest -n auto --dist worksteal

recordings: setup
	@$(PYTHON) tests/recordings/run.py $(DIR)

bench: setup
	@$(PYTHON) bench/run.py

UV_LOCK := $(PYTHON) -m uv pip compile -q pyproject.toml --universal --python-version 3.11 --generate-hashes \
	--no-annotate --no-header --no-emit-index-url

lock: setup
	@$(UV_LOCK) -o .ci/requirements.lock
	@$(UV_LOCK) --extra dev -o .ci/requirements-dev.lock
