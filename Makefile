# Readers need two commands: `make book` builds the site, `make test` checks it. `make help` lists the others.
# A target that names a file under .venv or _build is a stamp. It is made again when one of its prerequisites changes.

PYTHON ?= python3
# Several processes run at once, each with small matrices, where more threads would only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
# Hundreds of processes import the same packages, so their byte code is kept.
export PYTHONDONTWRITEBYTECODE :=
BIN := .venv/bin
ENV := .venv/.book
DEV := .venv/.dev
SITE := _build/.built$(if $(LIVE),-live)
COMPILE = $(BIN)/uv pip compile --quiet --universal --fork-strategy fewest --python-version 3.11 --generate-hashes \
	--no-annotate --custom-compile-command "make lock"
SOURCES := Makefile _config.yml _toc.yml tools/site.py tools/live.py tools/live.toml tools/vendored.py tools/vendored.toml tools/evidence.py tools/sheets.py tools/licences.txt $(shell find book src -type f -not -path '*/.*' -not -path '*/__pycache__/*' -not -path '*.egg-info/*')

.PHONY: help env book live test notebooks shake least fuzz lint bench study foreign release lock clean
.DELETE_ON_ERROR:

help:  ## list these commands
	@sed -n 's/^\([a-z]*\):.*##  *\(.*\)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18

env: $(DEV)  ## make .venv from the locked requirements, for the book, tests and tools

$(ENV): requirements.txt pyproject.toml tools/environment.py
	$(PYTHON) tools/environment.py

$(DEV): requirements-dev.txt $(ENV)
	$(PYTHON) tools/environment.py --dev

book: $(SITE)  ## build the site in _build/html from the stored outputs (a minute; LIVE=1: with cells that run in the browser)
	@echo "The site: _build/html/index.html"

$(SITE): $(ENV) $(SOURCES)
	LIVE=$(LIVE) $(BIN)/python tools/site.py
	touch $@

live: $(DEV)  ## fetch the Python that runs cells in the browser into .live, for LIVE=1 (a minute)
	$(BIN)/python tools/live.py

test: $(DEV) $(SITE)  ## run notebooks, doctests, short tests and a tenth of the long ones (5 minutes; with DRAW=1 all, 15 minutes)
	DRAW=$${DRAW:-10} $(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder --nbval --nbval-current-env

notebooks: $(ENV)  ## execute every notebook and store its outputs in place
	$(BIN)/python tools/notebooks.py

shake: $(DEV)  ## run every page with a slightly wrong library, and check that each number changes (about 3 minutes)
	$(BIN)/python tools/shake.py

least: $(DEV)  ## compare the notebooks' outputs on an emulated least capable processor (5 minutes)
	$(BIN)/python tools/least.py

fuzz: $(DEV)  ## check random loops, arguments, records and files by second methods, FUZZ=2000 of each (hours)
	FUZZ=$${FUZZ:-2000} $(BIN)/pytest -n auto tests/fuzz tests/lab/test_model.py

foreign: $(DEV)  ## tune on the records in FOLDER that tools/foreign.toml lists, and write the table (10 minutes)
	$(BIN)/python tools/foreign.py $(FOLDER) --out book/data/foreign.csv

lint: $(DEV)  ## check style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(DEV) $(SITE)  ## measure times and errors of this and other libraries, and update the pages that show them (20 minutes)
	$(BIN)/python -m benchmarks.run
	$(BIN)/python tools/notebooks.py book/speed/how-fast.ipynb

study: $(DEV)  ## run studies/NAME.py, which writes a table to book/data (minutes to hours)
	$(BIN)/python studies/$(NAME).py

release: $(DEV)  ## build wheel and source archive in dist, and try the wheel in an empty environment (a minute)
	$(BIN)/python tools/release.py

lock: $(DEV)  ## write both lock files from pyproject.toml, keeping their versions
	$(COMPILE) --extra book --extra tclab --output-file requirements.txt pyproject.toml
	$(COMPILE) --all-extras --constraint requirements.txt --output-file requirements-dev.txt pyproject.toml

clean:  ## remove everything that these commands made
	rm -rf .venv .live _build dist .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
