# Everything here works in a fresh clone with Python 3.11 to 3.13, a C++20 compiler and make; the
# rest comes from the package registries into .venv. PYTHON=python3.12 make demo picks another one.
PYTHON ?= python3
.DEFAULT_GOAL := help
NATIVE := pyproject.toml CMakeLists.txt $(shell find cpp -name '*.cpp' -o -name '*.h' -o -name CMakeLists.txt)
CPP := $(filter %.cpp %.h,$(NATIVE))
RUN := .venv/bin
PERCEPTION := fusion voxel normals icp refinement global_registration robust_registration \
  point_drift tracking
PIP = $(RUN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help demo test test-all test-cpp sanitize bench bench-perception docs examples lint format models clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /make \1|/' | column -t -s '|'

demo: .venv/.installed  ## watch an arm clear a bin, in the browser
	$(RUN)/prehensile demo clear-bin

test: .venv/.dev  ## the fast tests, the examples among them
	$(RUN)/python -m pytest -m "not slow"
	@touch build/examples/.run

test-all: .venv/.dev test-cpp  ## every test
	$(RUN)/python -m pytest

test-cpp: build/cpp/.tested  ## the C++ library's own tests

sanitize: build/sanitized/.tested  ## the same with AddressSanitizer and UndefinedBehaviorSanitizer

bench: .venv/.installed  ## our speed beside the peers', each in a virtual environment of its own
	$(RUN)/prehensile bench

bench-perception: .venv/.installed  ## the same for chapter 4: clouds, registration, tracking
	$(RUN)/prehensile bench $(PERCEPTION)

docs: .venv/.docs build/examples/.run  ## the documentation as web pages, in site/
	NO_MKDOCS_2_WARNING=1 $(RUN)/mkdocs build --strict --quiet

examples: build/examples/.run  ## run every example; their figures are in build/examples/

lint: .venv/.dev  ## ruff, pyright, clang-format
	$(RUN)/ruff check
	$(RUN)/ruff format --check
	$(RUN)/clang-format --dry-run -Werror $(CPP)
	$(RUN)/pyright

format: .venv/.dev  ## lay out all sources as `make lint` wants them
	$(RUN)/ruff check --fix-only
	$(RUN)/ruff format
	$(RUN)/clang-format -i $(CPP)

models: .venv/.installed  ## generate the embedded models anew
	$(RUN)/python -m prehensile.models.generate

clean:  ## remove everything that was built, .venv too
	rm -rf .venv build dist site

.venv/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
	  || { echo "prehensile needs Python 3.11 to 3.13: make PYTHON=python3.12 ..."; exit 1; }
	$(PYTHON) -m venv .venv

# The package is installed in place: Python files count as they are, C++ is built anew on change.
.venv/.installed: .venv/bin/python $(NATIVE)
	$(PIP) --editable .
	@touch $@

# The package is there already, so these add only what the extra names.
.venv/.dev: .venv/.installed
	$(PIP) 'prehensile[dev]'
	@touch $@

.venv/.docs: .venv/.installed
	$(PIP) 'prehensile[docs]'
	@touch $@

build/examples/.run: .venv/.dev $(wildcard examples/*.py)
	$(RUN)/python -m pytest -q tests/test_examples.py
	@touch $@

# The C++ library by itself, as a C++ project would build it.
SANITIZED := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
define TEST_CPP
	$(PIP) --no-deps --upgrade --target build/eigen cmeel-eigen
	$(RUN)/cmake -S . -B $(@D) -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(RUN)/ninja \
	  -DCMAKE_PREFIX_PATH=$(CURDIR)/build/eigen/cmeel.prefix $(1)
	$(RUN)/cmake --build $(@D)
	$(RUN)/ctest --test-dir $(@D) --output-on-failure
	@touch $@
endef

build/cpp/.tested: .venv/.dev $(NATIVE)
	$(call TEST_CPP)

build/sanitized/.tested: .venv/.dev $(NATIVE)
	$(call TEST_CPP,-DCMAKE_BUILD_TYPE=Debug '-DCMAKE_CXX_FLAGS=$(SANITIZED)')
