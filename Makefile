PYTHON ?= python3

.PHONY: report test clean

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

clean:
	rm -rf .venv .venv-test report
