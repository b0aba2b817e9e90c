# Everything from a bare machine with Python and make: `make demo`, `make test`.

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python3.10; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null && { command -v $$p; break; }; done)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.installed

export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help install demo test test-all check format bench sample-data clean

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

install: $(READY)  ## Set up .venv and the system libraries, and install the package

$(READY): pyproject.toml vto_pipeline/cli/setup_system.py
	@test -n "$(PYTHON)" || { echo "error: no Python 3.10 or later found" >&2; echo "  hint: sudo apt-get install -y python3" >&2; exit 5; }
	$(PYTHON) vto_pipeline/cli/setup_system.py $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

demo: $(READY)  ## Dress a customer in a shirt from photos (about 10 minutes on 2 cores the first time)
	$(BIN)/vto run configs/demo.yaml -o runs/demo
	@echo "Look at it: $(CURDIR)/runs/demo/out/page.html"

test: check  ## Check, and run every test that is not slow
	$(BIN)/python -m pytest

test-all: check  ## Check, and run all tests
	$(BIN)/python -m pytest -m ""

check: $(READY)  ## Lint, format, types, layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY)  ## Bring the source into form
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)  ## Measure error against run time (hours; `vto bench NAME --quick` takes minutes)
	$(BIN)/vto bench solvers integrators stability physics collision drape body scaling

sample-data: $(READY)  ## Generate sample_data/ again
	$(BIN)/python -m vto_pipeline.bench.samples --out sample_data

clean:  ## Remove what was built; runs/ and sample_data/ stay
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .import_linter_cache
	find vto_pipeline tests -name __pycache__ -prune -exec rm -rf {} +
