# One command sets up all that is needed and does the job; nothing has to be run before.
PYTHON ?= python3
# The robot's processor (`uname -m` there) and its Python.
ARCH ?= $(shell uname -m)
TARGET_PYTHON ?= 3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
LAB_STAMP := $(VENV)/.lab
# Most tests wait for processes and their timers: three a core, but of many cores no more than eight.
WORKERS ?= $(shell n=$$(nproc); echo $$((n < 3 ? 3 * n : 8)))
# As images for containers set it, each of some hundred processes would compile all sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test quick properties check format contract bench lab lab-install wheelhouse clean

demo: $(STAMP)  ## watch a robot cover a building nobody mapped before
	$(BIN)/fasaco-edge demo $(ARGS)

test: $(STAMP)  ## all tests
	# Compiles once what each test would wait for; and meanwhile what each worker would compile of the
	# tests themselves, ten seconds of processor time in a new clone.
	$(BIN)/python -m pytest --collect-only -q > /dev/null & \
	$(BIN)/fasaco-edge warmup; code=$$?; wait; exit $$code
	# In the order of collection: by default files with few tests, which take longest, would come
	# last. What a busy machine held up for too long runs once more; the closing line counts that.
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder --reruns 1 \
		--rerun-show-tracebacks $(ARGS)

quick: check  ## check, and the tests that import what has changed since the last commit: a minute or so
	files=$$($(BIN)/python -m tests.quick) && if [ -n "$$files" ]; then \
		$(BIN)/python -m pytest -q -n 2 --dist loadfile $(ARGS) $$files; fi

properties: $(STAMP)  ## tests over generated inputs, with sixteen times as many as `make test` tries
	EXAMPLES=4 $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m hypothesis $(ARGS)

check: $(STAMP)  ## format, lint, types, import contracts
	$(BIN)/ruff format --check . || { echo "to put them into their format: make format"; exit 1; }
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(STAMP)  ## put the sources into their format
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

contract: $(STAMP)  ## files of protocol/ that are made from the package: keys, QoS, schemas, tables
	$(BIN)/python -m tests.wire.contract_files

bench: $(STAMP)  ## a daemon's start, memory, load and delays on this computer
	$(BIN)/fasaco-edge bench daemon

lab: $(LAB_STAMP)  ## missions in a third-party simulator, judged by the true poses: some 5 min each
	$(BIN)/python -m tests.campaigns.lab table $(ARGS)

lab-install: $(STAMP)  ## what `make lab` needs, if that can be had here; without it `make test` skips the lab
	@$(MAKE) --no-print-directory $(LAB_STAMP) || echo "the lab cannot be installed here: its test is skipped"

wheelhouse: $(STAMP)  ## a folder in dist/ from which a robot is installed without a network
	PYTHONPATH=deploy $(BIN)/python -m wheelhouse --arch $(ARCH) --python $(TARGET_PYTHON) $(ARGS)

clean:  ## remove the environment and all that tools left behind
	rm -rf $(VENV) dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

# Kept apart from the targets above, so that a second run starts at once.
$(STAMP): pyproject.toml
	@$(PYTHON) -I -c 'import sys; sys.exit("fasaco_edge needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; try make PYTHON=python3.11") if sys.version_info < (3, 11) else 0'
	@echo "installing what is needed into $(VENV): a minute or two, without more lines"
	$(PYTHON) -I -m venv $(VENV)
	$(BIN)/python -I -m pip install --quiet --disable-pip-version-check --editable ".[dev]"
	touch $(STAMP)

$(LAB_STAMP): $(STAMP)
	$(BIN)/python -I -m pip install --quiet --disable-pip-version-check --retries 1 --editable ".[lab]"
	touch $(LAB_STAMP)
