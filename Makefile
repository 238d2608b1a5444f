# make demo   build the FMUs, run the demo, leave results and pictures in out/
# make test   every check and test, on a machine with nothing but Python >= 3.11 and make
# make torture   kill and interrupt every command 50 times, which make test does a few times
# make site   the site, out/site/index.html; opens from disk
# make install   what every command needs, into .venv
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
ALL := $(VENV)/all
TOOLS := $(VENV)/tools
NOTEBOOKS := $(wildcard docs/notebooks/*.ipynb)
SOURCES := $(shell find models fmus orchestrator -name '*.py')

.PHONY: demo install test torture test-basilisk site bench goldens docs figures lock clean

demo: $(STAMP)
	$(BIN)/gossamer demo

install: $(ALL)

test: $(TOOLS)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

torture: $(TOOLS)  # what make test does a few times: kill and interrupt every command
	$(BIN)/pytest -m torture --kills 50 --numprocesses auto --dist loadfile

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
	$(BIN)/pytest tests/bench --measure --override-ini addopts="-ra --import-mode=importlib -s"

docs: demo
	cp out/damage_begins/damage_history.png docs/demo.png
	$(BIN)/python docs/make_motion.py

goldens: $(TOOLS)
	$(BIN)/pytest tests/fmus tests/models/test_membrane_law.py tests/models/test_detector_posterior.py --rewrite-goldens

figures: $(TOOLS)
	$(BIN)/python docs/make_identification_page.py
	$(BIN)/python docs/make_membrane_page.py
	$(BIN)/python docs/make_damage_page.py

# Everything is pinned by hash; the project itself is installed editable on top. The demo needs the light packages and the
# compiler. Modules are compiled when they are imported, which takes less than to compile all that is installed, and kept.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip install --quiet --no-compile --no-deps
$(STAMP): constraints-light.txt constraints.txt pyproject.toml
	@echo "Installing what the demo needs into $(VENV), which takes half a minute to two minutes."
	$(PYTHON) -m venv $(VENV)
	sed -n -e '/^lief==/,/[^\]$$/p' -e '/^ziglang==/,/[^\]$$/p' constraints.txt > $(VENV)/compiler.txt
	$(PIP) --require-hashes -r constraints-light.txt -r $(VENV)/compiler.txt
	$(PIP) --no-build-isolation --editable .
	touch $(STAMP)

# What every command needs: campaigns, clusters, meshes, SSP, containers.
$(ALL): $(STAMP)
	$(PIP) --require-hashes -r constraints.txt
	touch $(ALL)

# What tests, site and figures need beside what runs: the same versions, and more.
$(TOOLS): constraints-dev.txt $(STAMP)
	@echo "Installing what tests and site need into $(VENV), which takes one to three minutes."
	$(PIP) --require-hashes -r constraints-dev.txt
	touch $(TOOLS)

# Needs uv (pip install uv); hatchling and editables are pinned too because the build runs without isolation. What is light
# has no CMake, notebooks and C compiler: FMPy asks for the first two, but no command of Gossamer makes it use them.
LOCK := printf "hatchling\neditables\n" | uv pip compile --universal --python-version 3.11 --generate-hashes --no-annotate \
    --no-header --no-emit-index-url --no-emit-find-links pyproject.toml -
RUN := --extra campaign --extra exchange --extra mesh --extra native

lock:
	$(LOCK) $(RUN) --extra notebook --extra docs --extra dev -o constraints-dev.txt
	$(LOCK) $(RUN) --constraint constraints-dev.txt -o constraints.txt
	mkdir -p build
	printf "cmake; python_version < '3'\nnbformat; python_version < '3'\n" > build/left_out.txt
	$(LOCK) --override build/left_out.txt --constraint constraints-dev.txt -o constraints-light.txt

clean:
	rm -rf $(VENV) out build dist docs/notebooks/out
