# make test        set up and pass all tests; HARNESSES="pi codex" says which agent programs are tested (default: pi);
#                  pi passes its whole failure matrix, other programs what needs no waiting; programs in CLIENTS only list
#                  the endpoint. Of long lists of cases it passes a share, with WHOLE=1 all
# make test-harnesses  install all agent programs and pass all tests that run them
# make recordings  score the embedded agent over a folder of recorded hosts: make recordings DIR=... [SAMPLE=3], and then
#                  over DEVICES generated ones (default 10000, 250 with a SAMPLE)
# make vm          boot emulated hosts with real kernels, onboard them and call their tools (docs/testing.md); needs root.
#                  ARCHES="amd64" takes one architecture alone
# make faults      inject every fault of the campaign into live deployments, TIMES times (default 5), and print a table
#                  (docs/faults.md); ONLY="words" takes the cases with one of these words in their names. Then spoil
#                  every file of a host MUTATIONS times (default 200; 0 leaves that out). Then kill an apply at each
#                  durable point. Then ten thousand commands and faults at random, of which `make test` tries
#                  five hundred: no limit is passed. Then all cases of long lists, and of properties fifty times the
#                  examples, other ones each time
# make soak        random faults at a high rate for SECONDS (default 3600): memory, processes, files and locks stay flat
# make coverage    run the unit tests and print how much of each package they reach; TESTS="tests/unit tests/faults" takes
#                  other ones. Measuring takes time and imports, so a few tests of those fail here
# make bench       print the measurements of bench/
# make lock        renew the lock files of .ci/ from pyproject.toml

PYTHON := .venv/bin/python
FROM_TESTS := PYTHONPATH=tests:tests/support $(PYTHON)
HARNESSES := pi
CLIENTS :=
export WHOLE ?=
ALL_HARNESSES := pi opencode claude-code codex gemini-cli qwen-code
# Programs go into a folder of the user that all checkouts share: OCTOFORM_AGENTS, else below the cache folder.
# Marked `patience` are the cells of the failure matrix that let seconds pass, with all programs but pi.
MARKED := ((not harness$(foreach name,$(HARNESSES), or harness_$(subst -,_,$(name)))) and not patience)\
	$(foreach name,$(CLIENTS), or (client and harness_$(subst -,_,$(name))))
# Two more than there are cores: many tests wait for a process.
WORKERS := $(shell expr $$(nproc) + 2)

# Where an image forbids bytecode, every process of the tests would compile what it imports again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup test suite test-harnesses programs compiled lint recordings vm faults soak coverage bench lock

setup:
	@.ci/setup dev

lint: setup
	@.venv/bin/ruff format --check .
	@.venv/bin/ruff check .
	@.venv/bin/mypy
	@.venv/bin/lint-imports

programs: setup
	@.venv/bin/octoform install $(sort $(HARNESSES) $(CLIENTS))
	@$(PYTHON) tests/conformance/suites.py

# The bytecode of the tests, which each worker would otherwise make for itself.
compiled: setup
	@printed=$$($(PYTHON) -m pytest --collect-only -q 2>&1) || { echo "$$printed"; exit 1; }

# With -j2 they are read and run at a time: the type checker uses one processor.
test: lint suite

suite: programs compiled
	@.ci/in-memory $(PYTHON) -m pytest -n $(WORKERS) --dist worksteal -m "$(MARKED)"

test-harnesses: HARNESSES := $(ALL_HARNESSES)
test-harnesses: programs
	@$(PYTHON) -m pytest -n auto --dist worksteal -m harness

DEVICES := $(if $(SAMPLE),250,10000)
recordings:
	@.ci/setup recordings
	@PYTHONPATH=tests:tests/support .ci/in-memory $(PYTHON) -m recordings.run $(DIR) $(if $(SAMPLE),--sample $(SAMPLE))
	@PYTHONPATH=tests:tests/support .ci/in-memory $(PYTHON) -m recordings.generated --devices $(DEVICES)

ARCHES := amd64 arm64
vm:
	@.ci/setup vm
	@$(FROM_TESTS) -m vm.image $(ARCHES)
	@$(PYTHON) -m pytest -n0 -v --durations=5 -m vm -k "$(subst $() $(), or ,$(strip $(ARCHES)))" -o faulthandler_timeout=0 tests/vm

TIMES := 5
ONLY :=
MUTATIONS := 200
SEED := 1
SECONDS := 3600
CAMPAIGN := $(FROM_TESTS) -m campaign
SHARED_TESTS = $(shell grep -rlE --include='test_*.py' '\bevery=[0-9]|import share' tests)
RANDOM_TESTS = $(shell grep -rl --include='test_*.py' 'from hypothesis' tests)
faults: setup
	@$(CAMPAIGN).run --times $(TIMES) --only $(ONLY)
	@$(CAMPAIGN).mutations --mutations $(MUTATIONS) --seed $(SEED) --workers $(WORKERS) --only $(ONLY)
	@EVERY_POINT=1 $(PYTHON) -m pytest -n $(WORKERS) tests/faults/test_faults_crash.py tests/unit/state/test_state_crash.py
	@SEEDS=4 COMMANDS=2500 $(PYTHON) -m pytest -n $(WORKERS) tests/integration/test_limits_under_faults.py
	@WHOLE=1 $(PYTHON) -m pytest -n $(WORKERS) $(SHARED_TESTS)
	@$(PYTHON) -m pytest -n $(WORKERS) -o faulthandler_timeout=0 --hypothesis-profile=random $(RANDOM_TESTS)

soak: setup
	@$(CAMPAIGN).soak --seconds $(SECONDS)

TESTS := tests/unit
coverage: setup
	@$(PYTHON) -m coverage erase
	-@$(PYTHON) -m coverage run -m pytest -n $(WORKERS) --dist worksteal -m "$(MARKED)" $(TESTS)
	@$(PYTHON) -m coverage combine -q
	@$(PYTHON) -m coverage json -q -o - | $(PYTHON) tests/coverage_table.py

bench: setup
	@.ci/in-memory $(PYTHON) bench/run.py

UV_LOCK := $(PYTHON) -m uv pip compile -q pyproject.toml --universal --python-version 3.11 --generate-hashes \
	--no-annotate --no-header --no-emit-index-url

lock: setup
	@$(UV_LOCK) -o .ci/requirements.lock
	@$(UV_LOCK) --extra dev -o .ci/requirements-dev.lock
