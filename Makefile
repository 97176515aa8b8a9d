# make demo | test | check | nightly | lowest | bench | docs. Every target sets up what it needs; the only requirements
# are CPython 3.11 and make.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEV := $(VENV)/.dev
SITE := $(VENV)/.site
JOBS ?= 2
# One process is one core: the pools of BLAS and OpenCV only get in each other's way.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: venv demo test nightly lowest check docs format kernels bench clean

venv: $(DEV)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable .
	touch $(STAMP)

# What tests and linters need besides.
$(DEV): $(STAMP)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --group dev --editable ".[gym]"
	touch $(DEV)

# What the documentation site needs besides.
$(SITE): $(DEV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[docs]"
	touch $(SITE)

demo: $(STAMP)
	$(BIN)/msrr dock two_units --seed 1 --out runs/demo
	@echo "Open runs/demo/replay.html in a browser: it shows the run."

# Tests start a hundred processes of their own, each of which would compile all modules anew where the environment
# forbids to keep bytecode: a third of their time.
test nightly lowest: export PYTHONDONTWRITEBYTECODE :=

test: $(DEV)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m "not nightly"

nightly: $(DEV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --group notebook --editable ".[dask,gym,profile,pyapriltags,rerun]"
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile

# The tests with the lowest versions that pyproject.toml admits. Pip does not choose them; uv does.
lowest: $(DEV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --group lowest
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python $(VENV)/lowest
	$(BIN)/uv pip install --quiet --python $(VENV)/lowest/bin/python --resolution lowest-direct \
		--group dev --editable ".[dask,gym,profile,pyapriltags,rerun]"
	$(VENV)/lowest/bin/python -m pytest -n $(JOBS) --dist loadfile -m "not nightly"

check: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(SITE)
	$(BIN)/python docs/site/make_site.py
	$(BIN)/zensical build --strict

format: $(DEV)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The machine code of the kernels, for lenses that distort and for ideal ones, which is compiled once for a version.
kernels: $(STAMP)
	$(BIN)/python -c "from msrr_bullet import load_scene; from msrr_bullet.sensors.preparation import prepare_cameras; \
		[prepare_cameras(load_scene('close_range', {'as_built': grade}), print) for grade in ('careful', 'perfect')]"

bench: $(STAMP)
	$(BIN)/msrr bench close_range --grade perfect --grade careful --against docs/results/speed/close_range.json
	$(BIN)/msrr bench sixteen --units 4 --against docs/results/speed/units.json

clean:
	rm -rf $(VENV) build dist runs
