# The commands a reader needs: `make book` builds the site, `make test` proves it. `make help` lists the rest.
# A target that names a file under .venv or _build is a stamp: it is done once, and again when what it stands on changes.

PYTHON ?= python3
# Two processes at once, with small matrices: more threads would only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
# Hundreds of processes import the same packages: their byte code is kept, in .venv and beside the sources.
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

help:  ## list these targets
	@sed -n 's/^\([a-z]*\):.*##  *\(.*\)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18

env: $(DEV)  ## make .venv from the locked requirements, with what tests and tools need

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

test: $(DEV) $(SITE)  ## unit tests, doctests, notebooks, and of the long tests one in ten (5 minutes; DRAW=1 runs all: 15)
	DRAW=$${DRAW:-10} $(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder --nbval --nbval-current-env

notebooks: $(ENV)  ## execute every notebook and store its outputs in place
	$(BIN)/python tools/notebooks.py

shake: $(DEV)  ## run every page with a library that is slightly off, and see each number move (about 3 minutes)
	$(BIN)/python tools/shake.py

least: $(DEV)  ## run the notebooks as the least capable processor would (5 minutes)
	$(BIN)/python tools/least.py

fuzz: $(DEV)  ## random loops, arguments, records and files against second methods, FUZZ=2000 of each (hours)
	FUZZ=$${FUZZ:-2000} $(BIN)/pytest -n auto tests/fuzz tests/lab/test_model.py

foreign: $(DEV)  ## tune on the plant records in FOLDER, which tools/foreign.toml lists, and write the table (10 minutes)
	$(BIN)/python tools/foreign.py $(FOLDER) --out book/data/foreign.csv

lint: $(DEV)  ## style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(DEV) $(SITE)  ## time and error beside other libraries and what the lab costs, for the pages that show them (20 minutes)
	$(BIN)/python -m benchmarks.run
	$(BIN)/python tools/notebooks.py $(patsubst %,book/%.ipynb,speed/how-fast audit/huba2018 audit/huba2024-portrait)

study: $(DEV)  ## run the study NAME of the folder studies, which writes a table of book/data (minutes to hours)
	$(BIN)/python studies/$(NAME).py

release: $(DEV)  ## build wheel and source archive in dist, install the wheel into an empty environment, use it (a minute)
	$(BIN)/python tools/release.py

lock: $(DEV)  ## write both locks from pyproject.toml, keeping the versions they already have
	$(COMPILE) --extra book --extra tclab --output-file requirements.txt pyproject.toml
	$(COMPILE) --all-extras --constraint requirements.txt --output-file requirements-dev.txt pyproject.toml

clean:  ## remove everything that was made
	rm -rf .venv .live _build dist .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
