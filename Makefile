# Everything runs in a virtual environment of the project's own; give PYTHON to choose another
# interpreter for it, or VENV to put it elsewhere.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
JOBS ?= auto

.PHONY: demo test lint format bench docs clean

$(BIN)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

demo: $(BIN)/.installed  ## render a short drive, run it, print its ATE/RTE table
	$(BIN)/p2gd-fgo demo --out results/demo --overwrite

# By file, because the tests of a file share what one of them has rendered or run; in the order of their
# names, because those with few tests are the long ones.
test: $(BIN)/.installed  ## the whole suite
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

lint: $(BIN)/.installed  ## format, style, types
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	MYPYPATH=experiments/doctor $(BIN)/mypy --explicit-package-bases experiments  # each has a run.py

format: $(BIN)/.installed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(BIN)/.installed  ## time per stage on the demo, or on SEQUENCE=path
	$(BIN)/python experiments/benchmark/run.py $(SEQUENCE)

docs: $(BIN)/.installed  ## the configuration's reference, from the code
	$(BIN)/python docs/make_reference.py

clean:
	rm -rf results build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache
