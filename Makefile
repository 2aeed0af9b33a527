PYTHON ?= python3

.PHONY: report test test-matrix clean

# The main job: core packages alone, then the evaluation report in report/index.html.
report: .venv/.stamp
	.venv/bin/steer-env report --out report

# Core, test and training packages, then the whole suite.
test: .venv-test/.stamp
	.venv-test/bin/python -m pytest

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

# A smoke test over versions of numba and with the lower bounds of all dependencies; prints docs/compatibility.md's table.
test-matrix:
	$(PYTHON) tests/matrix.py

clean:
	rm -rf .venv .venv-test report
