# Needs only make and Python 3.11 or newer. PYTHON=python3.12 make demo uses another Python.
PYTHON ?= python3
BIN := .venv/bin

# Debian's PETSc (apt-get install libpetsc-real3.18-dev openmpi-bin libopenmpi-dev), and the petsc4py of its version.
PETSC_DIR ?= /usr/lib/petscdir/petsc3.18/x86_64-linux-gnu-real
PETSC4PY ?= 3.18.5

SPHINX := -W --keep-going -n -q -j 2 -b html

.PHONY: demo docs docs-quick petsc test verification validity table1 hourglass bench viewer clean

demo: .venv/demo
	@$(BIN)/truespring verify examples/stretching.toml examples/bending.toml --out out/demo
	@echo "$(CURDIR)/out/demo/report.html"

test: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q -n 2 -m "not verification"

# Runs the long tests, those of PETSc if it is installed, and rebuilds docs/verification.md and the pictures of the pages.
verification: .venv/test $(if $(wildcard $(PETSC_DIR)/include/petscversion.h),.venv/petsc)
	$(BIN)/python -m pytest -q -n 2 --dist worksteal -m verification
	$(BIN)/python docs/build_verification.py
	$(BIN)/python docs/build_picture.py
	$(BIN)/python docs/build_theory.py

# Builds the site into out/docs: runs all notebooks and the gallery. Warnings are errors, and every link must lead somewhere.
docs: .venv/docs
	$(BIN)/sphinx-build $(SPHINX) -d out/doctrees docs out/docs
	$(BIN)/python docs/check_links.py out/docs

# The same without notebooks and gallery: pages, links, the Python reference.
docs-quick: .venv/docs-quick
	$(BIN)/sphinx-build $(SPHINX) -t quick -d out/doctrees-quick docs out/docs-quick
	$(BIN)/python docs/check_links.py out/docs-quick

# Measures Table 1 of the paper and rebuilds docs/table1.md. It measures times: run nothing else meanwhile.
table1: .venv/test
	$(BIN)/python docs/build_table1.py

# Solves the validity maps of all rules and rebuilds docs/validity.md and its pictures; takes a quarter of an hour.
validity: .venv/test
	$(BIN)/python docs/build_validity.py

# Measures the stiffness of Gaussian springs against hourglass and rebuilds docs/hourglass.md; takes some minutes.
hourglass: .venv/test
	$(BIN)/python docs/build_hourglass.py

# Times truespring, CalculiX (ccx on the path), FElupe and scikit-fem, and rebuilds docs/performance.md in at most 1.5 hours.
# Results are kept in benchmarks/.cache, so an interrupted run resumes. SIZES=small makes a short trial run.
# Then it measures live sessions, and rebuilds the table of docs/live.md.
bench: .venv/test .venv-peers/installed
	$(BIN)/python -m benchmarks $(if $(filter small,$(SIZES)),--small)
	$(BIN)/python -m benchmarks.live

# Bundles the interactive 3D view of reports with three.js; needs node. The result is kept in the repository.
viewer:
	cd viewer && npm ci --ignore-scripts && npm run build

# Builds petsc4py for linear = "petsc", see docs/large.md.
petsc: .venv/petsc

.venv/created:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "truespring needs Python 3.11 or newer; try: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv .venv
	touch $@

.venv/demo: .venv/created pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

.venv/test: .venv/created pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@ .venv/demo

.venv/docs: .venv/created pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@ .venv/docs-quick .venv/demo

.venv/docs-quick: .venv/created pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@ .venv/demo

.venv/petsc: .venv/test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'setuptools>=70.1,<81' 'cython<3.1' 'mpi4py>=4'
	PETSC_DIR=$(PETSC_DIR) PETSC_ARCH= $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps petsc4py==$(PETSC4PY)
	touch $@

.venv-peers/installed: .venv/created benchmarks/peers.txt
	$(PYTHON) -m venv .venv-peers
	echo '*' > .venv-peers/.gitignore
	.venv-peers/bin/python -m pip install --quiet --disable-pip-version-check --requirement benchmarks/peers.txt
	touch $@

clean:
	rm -rf .venv .venv-peers benchmarks/.cache out .mypy_cache .pytest_cache .ruff_cache .hypothesis
