PYTHON ?= python3
SEED := $(shell date +%s)
PYTEST = -m pytest --numprocesses auto --dist worksteal --hypothesis-profile=random --hypothesis-seed=$(SEED)
RUN = build/tests-run.txt

# The tests start many processes, which would compile every module that they import.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: report test check test-whole test-all test-matrix test-integrations release audit docs clean

# The main job: the core packages alone, then the evaluation report in report/index.html.
report: .venv/.stamp
	.venv/bin/steer-env report --out report

# What a contributor runs: the core, and the tests that need no more; the command has the seed of the property tests.
test: .venv-test/.stamp
	.venv-test/bin/python $(PYTEST) -m "not whole" --run-to=$(RUN)

# Format, lint, types, direction of imports, spelling of the pages.
check: .venv-test/.stamp-check
	.venv-test/bin/ruff format --check .
	.venv-test/bin/ruff check .
	.venv-test/bin/mypy
	.venv-test/bin/lint-imports
	.venv-test/bin/typos --format brief *.md docs/*.md

# Every test that `make test` did not run, with every extra: those marked `whole`, and what it skipped. From the Unix
# time UNTIL [s] on, if it is given, no test starts, and those left are named.
test-whole: .venv-whole/.stamp
	test -f $(RUN) || $(MAKE) test
	.venv-whole/bin/python $(PYTEST) --rest-of=$(RUN) $(if $(UNTIL),--until=$(UNTIL))

# The whole suite.
test-all: test check test-whole

# A short smoke test over several versions of numba and the lowest versions of all dependencies.
test-matrix:
	$(PYTHON) tests/tools/matrix.py

# Smoke tests with the libraries of docs/integrations.md.
test-integrations: .venv-whole/.stamp
	.venv-whole/bin/python -m pytest tests/integrations

# Source archive and wheel of the last commit in dist/, checked in empty environments; it says what is left by hand.
release:
	$(PYTHON) tests/tools/release.py dist

# Policy search against every reward: what scores more than the classical controllers must not behave worse.
audit: .venv-whole/.stamp
	.venv-whole/bin/python -m tests.maintain audit

# The site of the documentation in build/docs/index.html; plain Python draws its few pictures sooner than it compiles.
docs: .venv-docs/.stamp
	NUMBA_DISABLE_JIT=1 .venv-docs/bin/python -m tests.maintain site

.venv/.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	.venv/bin/python -m pip install --quiet --constraint constraints.txt --editable .
	touch $@

.venv-test/.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-test
	.venv-test/bin/python -m pip install --quiet --constraint constraints.txt --editable '.[test]'
	touch $@

.venv-test/.stamp-check: .venv-test/.stamp
	.venv-test/bin/python -m pip install --quiet --constraint constraints.txt --editable '.[check]'
	touch $@

# torch first and by itself: a range that another package asks for must not choose its build.
.venv-whole/.stamp: pyproject.toml constraints.txt constraints-train.txt constraints-integrations.txt
	$(PYTHON) -m venv .venv-whole
	.venv-whole/bin/python -m pip install --quiet --constraint constraints-integrations.txt torch
	.venv-whole/bin/python -m pip install --quiet --constraint constraints-integrations.txt --editable '.[whole]'
	touch $@

.venv-docs/.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-docs
	.venv-docs/bin/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

clean:
	rm -rf .venv .venv-test .venv-whole .venv-docs build/tests-run.txt build/docs build/docs-kept build/docs-sources build/docs-drawn report
