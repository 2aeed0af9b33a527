PYTHON ?= python3
SEED := $(shell date +%s)
PYTEST = .venv-test/bin/python -m pytest --numprocesses auto --dist worksteal \
	--hypothesis-profile=random --hypothesis-seed=$(SEED)

# The tests start many processes, which would compile every module that they import.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: report test types test-whole test-all test-matrix test-integrations audit docs clean

# The main job: the core packages alone, then the evaluation report in report/index.html.
report: .venv/.stamp
	.venv/bin/steer-env report --out report

# What a contributor runs: core, test and training packages, the types, then everything but the tests marked `whole`.
# The command that make prints has the random seed of the property tests.
test: types
	$(PYTEST) -m "not whole"

# The types of the packages; only what has changed is read again.
types: .venv-test/.stamp
	.venv-test/bin/python -m mypy

# The other tests.
test-whole: .venv-test/.stamp
	$(PYTEST) -m whole

# The whole suite.
test-all: test test-whole

# A short smoke test over several versions of numba and the lowest versions of all dependencies.
test-matrix:
	$(PYTHON) tests/tools/matrix.py

# Smoke tests with the libraries of docs/integrations.md.
test-integrations: .venv-integrations/.stamp
	.venv-integrations/bin/python -m pytest tests/integrations

# Policy search against every reward: what scores more than the classical controllers must not behave worse.
audit: .venv-test/.stamp
	.venv-test/bin/python -m tests.maintain audit

# The site of the documentation in build/docs/index.html; plain Python draws its few pictures sooner than it compiles.
docs: .venv-docs/.stamp
	NUMBA_DISABLE_JIT=1 .venv-docs/bin/python -m tests.maintain site

.venv/.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	.venv/bin/python -m pip install --quiet --constraint constraints.txt --editable .
	touch $@

# torch first and by itself: a range that another package asks for must not choose its build.
.venv-test/.stamp: pyproject.toml constraints.txt constraints-train.txt
	$(PYTHON) -m venv .venv-test
	.venv-test/bin/python -m pip install --quiet --constraint constraints-train.txt torch
	.venv-test/bin/python -m pip install --quiet --constraint constraints-train.txt --editable '.[train,test]'
	touch $@

.venv-integrations/.stamp: pyproject.toml constraints.txt constraints-train.txt constraints-integrations.txt
	$(PYTHON) -m venv .venv-integrations
	.venv-integrations/bin/python -m pip install --quiet --constraint constraints-integrations.txt torch
	.venv-integrations/bin/python -m pip install --quiet --constraint constraints-integrations.txt --editable '.[integrations,test]'
	touch $@

.venv-docs/.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-docs
	.venv-docs/bin/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

clean:
	rm -rf .venv .venv-test .venv-integrations .venv-docs build/docs build/docs-kept build/docs-sources build/docs-drawn report
