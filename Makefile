# All commands of a newcomer or of CI. Each target sets up .venv first, which takes milliseconds and no
# network once it is done.
#
#   make demo | test | test-full | test-linuxcnc | lint | bench | docs | figures | screenshots | clean
#   make test ARGS="-k gauges"       more arguments for the program
#   make PYTHON=python3.12 test      the Python for .venv, the first time

PYTHON = python3
ARGS =
# Tests of devices mostly wait, so that four processes keep two cores busy. In the order of the folders
# the long files come early; by default files with few tests, which are the long ones, would come last.
SEVERAL_AT_A_TIME = -n 4 --dist loadfile --no-loadscope-reorder
# Not even imported, by each of them. The documents are checked by make lint.
DOCUMENTS = tests/docs/checks
ELSEWHERE = --ignore=tests/benchmarks --ignore=tests/linuxcnc --ignore=$(DOCUMENTS)
RUN = .venv/bin/python -m

# Packages of other software on these paths would take precedence over the pinned ones.
unexport PYTHONPATH PYTHONHOME

# Tests start a hundred processes, which should not compile the same files each time.
unexport PYTHONDONTWRITEBYTECODE

# The matrices are small: threads of the linear algebra only slow them down.
export OPENBLAS_NUM_THREADS = 1

.PHONY: demo test test-full test-linuxcnc lint bench docs figures screenshots clean venv

demo: venv
	.venv/bin/hexacell demo $(ARGS)

test: venv
	$(RUN) pytest $(SEVERAL_AT_A_TIME) $(ELSEWHERE) -m "not slow and not benchmark and not linuxcnc" $(ARGS)

test-full: venv
	$(RUN) pytest $(SEVERAL_AT_A_TIME) $(ELSEWHERE) -m "not benchmark and not linuxcnc" $(ARGS)

# One pass over all benchmarks, half an hour on two cores, that goes on where one fails or misses its target. The
# figures go into build/figures.json. FULL=1 takes the samples of the targets, for hours (tests/benchmarks/samples.py).
bench:
	@.ci/venv "$(PYTHON)" bench
	HEXACELL_FIGURES="$(CURDIR)/build/figures.json" \
		$(RUN) pytest tests/benchmarks -s --timeout=$(if $(FULL),0,600) --durations=10 $(ARGS)

# One LinuxCNC a machine, in real time; ARGS="-m linuxcnc" for all faults, an hour. docs/linuxcnc.md says how
# it is installed.
test-linuxcnc: venv
	$(RUN) pytest tests/linuxcnc --timeout=1200 -m "not slow" $(ARGS)

lint: venv
	$(RUN) ruff check
	$(RUN) ruff format --check
	$(RUN) mypy
	.venv/bin/lint-imports --no-logo
	$(RUN) pytest -q $(DOCUMENTS)

venv:
	@.ci/venv "$(PYTHON)"

# A site that needs no network, neither to be made nor to be read; whatever is wrong in it is an error.
docs: venv
	$(RUN) sphinx --fail-on-warning --keep-going --quiet -c docs . build/site $(ARGS)
	@echo "hexacell: the site is build/site/index.html"

# The pictures of README and docs, and the table of what the last `make bench` measured; CONTRIBUTING.md says which
# is made by what. The study of designs takes seven minutes on two cores.
figures: venv
	HEXACELL_UPDATE_SNAPSHOTS=1 $(RUN) pytest -q tests/screen/test_snapshots.py tests/docs/test_howto_pictures.py
	for cell in simulated-hexaglide gough-stewart linapod rotary-cranks five-legs four-arms; do \
		.venv/bin/hexacell view configs/$$cell.toml --output docs/robot-$$cell.svg --no-open; done
	rm -rf build/study
	.venv/bin/hexacell study paper --folder build/study
	cp build/study/paper.svg docs/study-paper.svg
	$(RUN) docs.minutes
	$(RUN) tests.benchmarks.figures

screenshots:
	@.ci/screenshots build/screenshots

clean:
	rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
