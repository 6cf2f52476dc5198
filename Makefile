# Needs Python 3.11 or newer and make, nothing else. PYTHON=python3.12 make demo chooses another.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test verification validity table1 bench viewer clean

demo: .venv/demo
	@$(BIN)/truespring verify examples/stretching.toml examples/bending.toml --out out/demo
	@echo "$(CURDIR)/out/demo/report.html"

test: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q -n 2 -m "not verification"

# What takes long, and the page of measured figures that it rebuilds.
verification: .venv/test
	$(BIN)/python -m pytest -q -m verification
	$(BIN)/python docs/build_verification.py
	$(BIN)/python docs/build_picture.py

# The paper's Table 1, measured anew: rebuilds docs/table1.md; let nothing else run meanwhile.
table1: .venv/test
	$(BIN)/python docs/build_table1.py

# The validity maps of all rules, solved anew: rebuilds docs/validity.md and its pictures, in a quarter of an hour.
validity: .venv/test
	$(BIN)/python docs/build_validity.py

# truespring beside CalculiX (ccx on the path), FElupe and scikit-fem: rebuilds docs/performance.md, in an hour or two.
# What was run is kept in benchmarks/.cache, and goes on where it broke off; SIZES=small is for trying it out.
bench: .venv/test .venv-peers/installed
	$(BIN)/python -m benchmarks $(if $(filter small,$(SIZES)),--small)

# The scene of the report that turns, bundled with three.js; needs node. The result is kept in the repository.
viewer:
	cd viewer && npm ci --ignore-scripts && npm run build

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

.venv-peers/installed: .venv/created benchmarks/peers.txt
	$(PYTHON) -m venv .venv-peers
	echo '*' > .venv-peers/.gitignore
	.venv-peers/bin/python -m pip install --quiet --disable-pip-version-check --requirement benchmarks/peers.txt
	touch $@

clean:
	rm -rf .venv .venv-peers benchmarks/.cache out .mypy_cache .pytest_cache .ruff_cache .hypothesis
