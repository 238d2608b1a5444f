# make demo   build the FMUs, run the demo, leave results and pictures in out/
# make test   every check and test, on a machine with nothing but Python >= 3.11 and make
# make site   the site, out/site/index.html; opens from disk
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
TOOLS := $(VENV)/tools
NOTEBOOKS := $(wildcard docs/notebooks/*.ipynb)
SOURCES := $(shell find models fmus orchestrator -name '*.py')

.PHONY: demo test test-basilisk site bench goldens docs figures lock clean

demo: $(STAMP)
	$(BIN)/gossamer demo

test: $(TOOLS)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/pytest --numprocesses auto --dist loadfile

site: $(TOOLS) $(NOTEBOOKS:docs/notebooks/%=docs/notebooks/out/%)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict  # with --quiet it would count no warning

# What the site shows of a notebook is what it does now: run again where it or any code is newer.
docs/notebooks/out/%.ipynb: docs/notebooks/%.ipynb $(SOURCES) $(TOOLS)
	mkdir -p $(@D)
	$(BIN)/python -c "from nbclient.cli import main; main()" --timeout=600 --output=out/$* $<

# Basilisk takes 270 MB, so it has an environment of its own and is not among the pinned packages.
test-basilisk:
	$(PYTHON) -m venv build/basilisk
	build/basilisk/bin/python -m pip install --quiet --require-hashes --no-deps -r constraints-dev.txt
	build/basilisk/bin/python -m pip install --quiet "bsk>=2.12,<3"
	build/basilisk/bin/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	build/basilisk/bin/pytest tests/hosts/test_basilisk.py

bench: $(TOOLS)
	$(BIN)/pytest tests/bench --override-ini addopts="-ra --import-mode=importlib -s"

docs: demo
	cp out/damage_begins/damage_history.png docs/demo.png
	$(BIN)/python docs/make_motion.py

goldens: $(TOOLS)
	$(BIN)/pytest tests/fmus --rewrite-goldens
	$(BIN)/python docs/make_front_door.py

figures: $(TOOLS)
	$(BIN)/python docs/make_identification_page.py
	$(BIN)/python docs/make_membrane_page.py
	$(BIN)/python docs/make_damage_page.py

# Everything is pinned by hash; the project itself is installed editable on top.
$(STAMP): constraints.txt pyproject.toml
	@echo "Installing what runs into $(VENV), which takes one to three minutes."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r constraints.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $(STAMP)

# What tests, site and figures need beside what runs: the same versions, and more.
$(TOOLS): constraints-dev.txt $(STAMP)
	@echo "Installing what tests and site need into $(VENV), which takes one to three minutes."
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r constraints-dev.txt
	touch $(TOOLS)

# Needs uv (pip install uv); hatchling and editables are pinned too because the build runs without isolation.
RUN := --extra campaign --extra mesh --extra native
LOCK := uv pip compile --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --no-emit-index-url \
    --no-emit-find-links pyproject.toml -

lock:
	printf "hatchling\neditables\n" | $(LOCK) $(RUN) --extra notebook --extra docs --extra dev -o constraints-dev.txt
	printf "hatchling\neditables\n" | $(LOCK) $(RUN) --constraint constraints-dev.txt -o constraints.txt

clean:
	rm -rf $(VENV) out build dist docs/notebooks/out
