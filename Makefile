# Everything here works from a fresh clone with Python 3.11, make and git; no compiler is needed.
#
#   make run                      set up .venv, optimise cases/fig6.yaml, write results/fig6.h5
#   make test                     set up .venv with the tools of development, run the tests
#   make test-all                 the thorough tests, too (tests/tiers.py): some 20 minutes
#   make test-times               the tests, and where their time goes: by test, file and compiled kernel
#   make test-lowest              all of them with the lowest versions of dependencies that pyproject.toml allows
#   make test-numba               kernels, gradients and warm starts with the oldest, a middle and the newest Numba
#   make test-bounds              the tests of kernels, with every place in an array checked
#   make lint, make types         ruff, and who may import whom; mypy
#   make docs                     the documentation, into site/index.html
#   make reproduce                every figure and table of the paper, into results/index.html
#   make gallery                  compute the cases of gallery/, draw them, write docs/gallery.md
#   make bench                    measure what the pages quote (SECTIONS="speed bars" for some of it)
#   make bench PEERS=DIR          compare with the programs in DIR, run by PEERS_PYTHON
#   make peers                    compare with other programs, which it installs (SECTIONS=ring for some of it)
#   make readme                   measure everything, put the tables into docs/, five rows into the README
#   make wheel                    a wheel with compiled kernels, into dist/ (some minutes)
#   make try-wheel                install that wheel afresh, and see that no command compiles anything
#   make clean                    remove the environment and whatever was made; results stay

PYTHON ?= $(or $(shell command -v python3.11),python3)
VENV ?= .venv
# the environment of `make test-lowest`
LOWEST ?= .venv-lowest
# environments of `make test-numba`, one for each version: the lower bound of pyproject.toml, one between, the newest
NUMBAS ?= oldest 0.64 newest
NUMBA_VENVS ?= .venv-numba
# tests of `make test-bounds`, and of `make test-numba`
BOUNDS_TESTS ?= tests/mechanics tests/general tests/integrators tests/sensitivity tests/engine/test_gradients.py
NUMBA_TESTS ?= tests/compiler tests/mechanics tests/engine/test_gradients.py
BIN := $(VENV)/bin
CASE ?= cases/fig6.yaml
RESULT := results/$(basename $(notdir $(CASE))).h5
# options of `mdstopo run`, e.g. ARGS=--overwrite
ARGS ?=
# options of pytest, e.g. TESTS="tests/case -x"; how many processes run tests, 0 for this one
TESTS ?=
JOBS ?= 2
SECTIONS ?=
PEERS ?=
PEERS_PYTHON ?= $(BIN)/python

export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Numba writes many messages that nobody reads; colours take a twentieth of the time to compile where colorama is there
export NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING := 1

.DELETE_ON_ERROR:
.PHONY: help run test test-all test-times test-lowest test-numba test-bounds lint types docs reproduce gallery bench peers readme wheel try-wheel clean

help:
	@sed -n 's/^# \{0,1\}//p' Makefile | sed -n 3,20p

# Installed in place, so that the sources are current; anew only when the project's requirements change.
$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or later is needed: make PYTHON=...")'
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

# Only what is missing: the package is there and stays as it is, so something may run meanwhile.
$(VENV)/.ready-dev: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet 'mdstopo[dev]'
	@touch $@

# An unfinished run goes on where it stopped; a finished one is replaced, with a notice.
run: $(VENV)/.ready
	@args='$(ARGS)'; \
	if [ -z "$$args" ] && [ -f $(RESULT) ] && \
	   $(BIN)/mdstopo show --json $(RESULT) 2>/dev/null | grep -Eq '"status": "(running|interrupted)"'; then \
	  args=--resume; fi; \
	echo mdstopo run $(CASE) $$args; \
	$(BIN)/mdstopo run $(CASE) $$args || exit; \
	case " $$args " in *" --out "*) ;; *) printf '%s\n' 'What next, with $(BIN)/mdstopo:' \
	  '  mdstopo show $(RESULT)     the result in words' \
	  '  mdstopo report $(RESULT)   one page with the motion' \
	  '  mdstopo new --list         templates of cases of your own';; esac

$(VENV)/.ready-plot: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --editable '.[plot]'
	@touch $@

# Goes on where it was stopped; what is made and current is left alone.
reproduce: $(VENV)/.ready-plot
	$(BIN)/python -m reproduce

test: $(VENV)/.ready-dev
	$(BIN)/python -m pytest --numprocesses $(JOBS) --dist loadfile -m 'not thorough' $(TESTS)

test-all: $(VENV)/.ready-dev
	$(MAKE) $(VENV)/.ready-docs
	$(BIN)/python -m pytest --numprocesses $(JOBS) --dist loadfile $(TESTS)

test-times: $(VENV)/.ready-dev
	$(BIN)/python -m pytest --numprocesses $(JOBS) --dist loadfile -m 'not thorough' --times $(TESTS)

# What a plain installation, pictures and a cluster need, each at its lower bound; the tools of development as they are.
$(LOWEST)/.ready: pyproject.toml
	$(PYTHON) -m venv --clear $(LOWEST)
	$(PYTHON) -c 'import tomllib; \
	  project = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
	  extras = project["optional-dependencies"]; \
	  print(*(each.replace(">=", "==") for each in project["dependencies"] + extras["plot"] + extras["cluster"]), sep="\n")' \
	  > $(LOWEST)/lowest.txt
	$(LOWEST)/bin/python -m pip install --quiet --constraint $(LOWEST)/lowest.txt --editable '.[dev,docs]'
	@touch $@

test-lowest: $(LOWEST)/.ready
	$(LOWEST)/bin/python -m pytest --numprocesses $(JOBS) --dist loadfile $(TESTS)

# A version that pip does not find for this Python is left out, and said so.
$(NUMBA_VENVS)/%/.ready: pyproject.toml
	$(PYTHON) -m venv --clear $(@D)
	@wanted=$*; case $$wanted in \
	  oldest) wanted=$$(sed -n 's/^ *"numba>=\([0-9.]*\).*/numba==\1/p' pyproject.toml);; \
	  newest) wanted=numba;; \
	  *) wanted="numba==$$wanted.*";; esac; \
	if $(@D)/bin/python -m pip install --quiet "$$wanted"; then \
	  $(@D)/bin/python -m pip install --quiet --upgrade-strategy only-if-needed --editable '.[dev]'; \
	else echo "$$wanted cannot be installed for this Python: left out"; touch $(@D)/left-out; fi
	@touch $@

test-numba: $(foreach version,$(NUMBAS),$(NUMBA_VENVS)/$(version)/.ready)
	@failed=; for version in $(NUMBAS); do \
	  place=$(NUMBA_VENVS)/$$version; \
	  if [ -e $$place/left-out ]; then echo "Numba $$version: left out"; continue; fi; \
	  $$place/bin/python -c 'import llvmlite, numba; print("Numba", numba.__version__, "llvmlite", llvmlite.__version__)'; \
	  $$place/bin/python -m pytest --numprocesses $(JOBS) --dist loadfile $(or $(TESTS),$(NUMBA_TESTS)) || failed="$$failed $$version"; \
	done; \
	if [ -n "$$failed" ]; then echo "failed with Numba$$failed"; exit 1; fi

test-bounds: $(VENV)/.ready-dev
	NUMBA_BOUNDSCHECK=1 $(BIN)/python -m pytest --numprocesses $(JOBS) --dist loadfile $(or $(TESTS),$(BOUNDS_TESTS))

lint: $(VENV)/.ready-dev
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-cache

types: $(VENV)/.ready-dev
	$(BIN)/mypy

$(VENV)/.ready-docs: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	@touch $@

docs: $(VENV)/.ready-docs
	$(BIN)/python -m mkdocs build --strict
	@echo open site/index.html

gallery: $(VENV)/.ready-plot
	$(BIN)/python -m benchmarks.gallery

# what benchmarks compare with beside the peers
$(VENV)/.ready-bench: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --editable '.[ga]'
	@touch $@

bench: $(VENV)/.ready-bench
	$(BIN)/python -m benchmarks $(SECTIONS) $(if $(PEERS),--peers '$(PEERS)' --peers-python '$(PEERS_PYTHON)')

# The programs to compare with, beside mdstopo in one environment.
$(VENV)/.ready-peers: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --editable '.[peers]'
	@touch $@

peers: $(VENV)/.ready-peers
	$(BIN)/python -m benchmarks $(or $(SECTIONS),peers ring forward seat million)

# Machine code is compiled for each kind of processor, or found in the cache, and put into the wheel.
wheel: $(VENV)/.ready
	$(BIN)/python packaging/ship_kernels.py build/kernels
	@rm -f dist/mdstopo-*.whl
	MDSTOPO_KERNELS=$(CURDIR)/build/kernels $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .
	@ls -l dist/*.whl

# In an environment of its own: no command may compile anything.
try-wheel:
	$(BIN)/python packaging/try_wheel.py dist/mdstopo-*.whl

readme: $(VENV)/.ready-bench
	$(BIN)/python -m benchmarks --readme

clean:
	rm -rf $(VENV) $(LOWEST) $(NUMBA_VENVS) build dist site *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
