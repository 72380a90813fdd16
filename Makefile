# `make demo` and `make test` are all that a fresh machine needs (Python >= 3.11 and make).
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.DEFAULT_GOAL := help
.PHONY: help demo test check bench scoreboard lock clean

help: ## this list
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1	/' | expand -t 16

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "boresight needs Python 3.11 or newer; '$(PYTHON)' is $$($(PYTHON) -V 2>&1). Try: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 2; }
	@$(PYTHON) -m venv $(VENV)

# One stamp per extra: the pinned wheels (hashes checked), then the package itself, editable.
$(VENV)/.run $(VENV)/.test $(VENV)/.bench: $(VENV)/.%: constraints/%.txt pyproject.toml | $(BIN)/python
	@echo "installing ($*) into $(VENV) …"
	@$(PIP) install --only-binary :all: --require-hashes -r constraints/$*.txt
	@$(PIP) install --no-deps --no-build-isolation -e .
	@touch $@

demo: $(VENV)/.run ## simulate radar and infrared on two aircraft, track, score, write the report
	@$(BIN)/boresight demo -o demo --force

test: $(VENV)/.test ## install the test extra and run the tests
	$(BIN)/python -m pytest -n 2 --dist worksteal

check: $(VENV)/.test ## ruff, strict types, layers, doctests, docs
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --config-file= --ignore-missing-imports -p benchmarks
	$(BIN)/python -m pytest -q tests/test_layers.py tests/test_docs.py
	$(BIN)/python -m pytest -q --doctest-modules src/boresight

bench: $(VENV)/.bench ## measure speed against the peers (Stone Soup, FilterPy, NumPy, SciPy)
	$(BIN)/python -m benchmarks

scoreboard: $(VENV)/.run ## the real recordings in ../shared/data, every sensor combination
	$(BIN)/python -m benchmarks.scoreboard --page docs

lock: ## pin the dependencies again (needs uv)
	@printf 'hatchling>=1.27\neditables\n' > .build.in
	@for extra in run test bench; do \
	  case $$extra in run) flags= ;; test) flags="--extra test" ;; bench) flags="--extra test --extra bench" ;; esac; \
	  uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-annotate --no-header \
	    --python-version 3.11 $$flags pyproject.toml .build.in -o constraints/$$extra.txt > /dev/null || exit 1; \
	done; rm -f .build.in

clean: ## remove the environment and everything made
	rm -rf $(VENV) demo .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests benchmarks -name __pycache__ -prune -exec rm -rf {} +
