# `make help` lists the targets. Everything is installed into .venv; nothing else is touched.
#
#   PYTHON=python3.12 make test                the interpreter that .venv is made from
#   PIP_FLAGS='--extra-index-url ...' make test    more options for pip (README: the CPU build of torch)

PYTHON ?= python3
PIP_FLAGS ?=
VENV := .venv
BIN := $(VENV)/bin
MADE := $(VENV)/.made
READY := $(VENV)/.ready
COMPLETE := $(VENV)/.complete
INDEX := $(VENV)/share/ament_index/resource_index/packages
PIP = $(CLEAN) $(BIN)/python -m pip install --disable-pip-version-check --constraint requirements.lock
CHATTER := '^Collecting|^Looking in|^Requirement already|Obtaining|\.metadata|WARNING: Location|ninstall|Checking if|Preparing|Building|Created wheel|Stored in|Successfully built|Installing collected'
SHARE := $(VENV)/share/rigid_gns_ros
# A ROS workspace or another environment that is active must not reach into this one.
CLEAN := env -u PYTHONPATH -u PYTHONHOME -u VIRTUAL_ENV -u LD_LIBRARY_PATH -u _ROS_WHEELS_BOOTSTRAP_COMPLETE
TESTS ?= tests

.DEFAULT_GOAL := help
.PHONY: help venv engine demo test lint format docs lock clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

venv: $(READY)  ## make .venv with what the demo needs, anew when requirements.lock changes

demo: engine  ## tracker, simulator, bag and report of 20 s with 154 spheres
	@$(CLEAN) $(BIN)/python -m rigid_gns_ros.demo

test: $(COMPLETE) engine  ## run all tests (TESTS=tests/engine for a part)
	@$(CLEAN) $(BIN)/python -m pytest -n 2 $(TESTS)

engine: $(READY)  ## compile the engine once (about a minute), so that nothing waits for it later
	@$(CLEAN) $(BIN)/python -m rigid_gns_core.engine
	@$(CLEAN) $(BIN)/python -m rigid_gns_core.tracking

lint: $(COMPLETE)  ## run what pre-commit runs: ruff, mypy, import contract, well-formed files
	@$(CLEAN) $(BIN)/ruff check .
	@$(CLEAN) $(BIN)/ruff format --check .
	@$(CLEAN) $(BIN)/mypy
	@$(CLEAN) $(BIN)/lint-imports --no-cache --no-logo
	@$(CLEAN) $(BIN)/python .ci/check_files.py

format: $(COMPLETE)  ## let ruff format the code and repair what it can
	@$(CLEAN) $(BIN)/ruff check --fix .
	@$(CLEAN) $(BIN)/ruff format .

docs: $(COMPLETE)  ## build the site in build/docs/: open index.html; a warning is an error
	@$(CLEAN) $(BIN)/python -m sphinx -W --keep-going -q -b html docs build/docs

lock: $(READY)  ## add to requirements.lock what setup.py newly asks for (UV_FLAGS=--upgrade: all anew)
	@$(PIP) --quiet uv
	@$(CLEAN) $(BIN)/uv pip compile setup.py --extra all --quiet --no-annotate \
	  --python-version 3.11 --python-platform x86_64-unknown-linux-gnu \
	  --custom-compile-command 'make lock' --output-file requirements.lock $(UV_FLAGS)

clean:  ## remove .venv and everything that was built
	rm -rf $(VENV) build dist install log *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# A changed lock gives a new environment, so that nothing stale is left in it.
$(MADE): requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' 2>/dev/null || { \
	  echo "make: $(PYTHON) is $$($(PYTHON) --version 2>/dev/null || echo not there), but Python 3.11 or 3.12 is needed." >&2; \
	  echo "      Name one that is installed: make PYTHON=python3.11 $(MAKECMDGOALS)" >&2; exit 1; }
	@$(CLEAN) $(PYTHON) -m venv --clear $(VENV)
	@$(PIP) --quiet $(PIP_FLAGS) setuptools
	@touch $@

$(READY): $(MADE) setup.py setup.cfg pyproject.toml
	@echo 'make: installing what the demo needs into $(VENV): once, a minute, 0.8 GB'
	@$(call install,demo)
	@# an editable install has no ament marker: with these, AMENT_PREFIX_PATH=$$PWD/.venv is a ROS prefix
	@mkdir -p $(INDEX) $(SHARE) $(VENV)/lib/rigid_gns_ros
	@ln -sfn $(CURDIR)/resource/rigid_gns_ros $(INDEX)/rigid_gns_ros
	@for name in package.xml config launch; do ln -sfn $(CURDIR)/$$name $(SHARE)/$$name; done
	@for name in simulator tracker evaluate; do ln -sfn ../../bin/$$name $(VENV)/lib/rigid_gns_ros/$$name; done
	@touch $@

$(COMPLETE): $(READY)
	@echo 'make: installing the rest of requirements.lock into $(VENV): once, some minutes, 2.6 GB in all'
	@$(call install,all)
	@touch $@

# pip's progress without its chatter; its exit status passes the filter by a file
install = { $(PIP) --progress-bar off --no-build-isolation $(PIP_FLAGS) --editable '.[$(1)]' 2>&1; \
  echo $$? > $(VENV)/.status; } | grep --line-buffered -vE $(CHATTER); exit $$(cat $(VENV)/.status)
