# Everything from a bare machine with Python and make: `make demo`, `make test`.

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python3.10; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null && { command -v $$p; break; }; done)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.installed
WORKERS ?= auto

export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help install demo test test-all test-processors check-demo check format docs bench figures first-run sample-data \
	image clean

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
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile

test-all: check  ## Check, and run all tests
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile -m ""

test-processors: $(READY)  ## Run the tests as other processors compute (an hour; NAMES="generic x86-64-v3" for some)
	.ci/processors $(NAMES)

check-demo: $(READY)  ## Run the sample documents from photos, depth, cloud and mesh to the page, against their bars
	mkdir -p runs
	$(BIN)/python -m pytest -m check_demo --basetemp runs/check

check: $(READY)  ## Lint, format, types, layers, spelling, pages
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell
	$(BIN)/python -m vto_pipeline.bench.docs --check

format: $(READY)  ## Bring the source into form
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(READY)  ## Write README.md and docs/ from docs/source and docs/results
	$(BIN)/python -m vto_pipeline.bench.docs

bench: $(READY)  ## Measure error against run time (hours; `vto bench NAME --quick` takes minutes)
	$(BIN)/vto bench all

figures: $(READY)  ## Measure what the pages quote again (about an hour on a quiet machine), and write the pages
	$(BIN)/vto bench all --quick --out docs/results
	$(BIN)/vto bench physics --out docs/results
	$(BIN)/python -m vto_pipeline.bench.docs

first-run:  ## In a fresh clone: clock `make demo` and `make test` from nothing
	@test ! -e $(VENV) || { echo "error: $(VENV) is there; wanted a fresh clone" >&2; exit 2; }
	@began=$$(date +%s) && $(MAKE) demo && demo=$$(($$(date +%s) - began)) && \
		$(MAKE) test && test=$$(($$(date +%s) - began - demo)) && \
		$(BIN)/python -m vto_pipeline.bench.first_run --demo $$demo --test $$test

image:  ## Build a Docker image with the command vto
	docker build --tag vto-pipeline .

sample-data: $(READY)  ## Generate sample_data/ again
	$(BIN)/python -m vto_pipeline.bench.samples --out sample_data

clean:  ## Remove what was built; runs/ and sample_data/ stay
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .import_linter_cache
	find vto_pipeline tests -name __pycache__ -prune -exec rm -rf {} +
