# gustform: everything from a fresh machine to figures, tests and documents.
#
# Set-up steps leave a stamp in .venv or build, so a second run does only what a change asks for:
#   pyproject.toml or the constraints changed -> pip;  a C source changed -> ninja;  nothing changed -> nothing.
# PYTHON names the interpreter of the virtual environment: make PYTHON=python3.12 demo

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS += --no-builtin-rules --no-print-directory
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON ?= python3
DEMO_SCENARIO := cli/gustform_cli/scenarios/load_step_8ms.yaml
DEMO_OUT := demo

VENV := .venv
BIN := $(VENV)/bin
# Neither a virtual environment nor a CMake tree survives a move, so the stamps carry the place they are good for.
PLACE := $(shell printf '%s' '$(CURDIR)' | cksum | cut -d' ' -f1)
VENV_STAMPS := $(VENV)/.stamps-$(PLACE)
BUILD_STAMPS := build/.stamps-$(PLACE)

C_CONFIGURATION := CMakeLists.txt $(shell find runtime tests/c hil/bridge -name CMakeLists.txt -o -name '*.cmake' 2>/dev/null)
RUNTIME_SOURCES := $(shell find runtime/include runtime/src -type f 2>/dev/null)
TEST_SOURCES := $(shell find tests/c hil/bridge -type f 2>/dev/null)
# For clang-tidy: the bridge is compiled in a rig, with a controller and a message set.
BRIDGE_FLAGS := -std=gnu11 -Ihil/bridge/include -Icodegen/gustform_codegen/emit/controller -DGUST_BRIDGE_PREFIX=dual_port

PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input --constraint tools/constraints.txt
# Set-up runs in a make of its own under a lock, so that two makes in one work tree do not both build it.
SET_UP = +@flock .make.lock $(MAKE) --silent
# The output of a step that normally says nothing of interest; shown when the step fails.
QUIETLY = tools/quietly.sh
say = @echo '== $(1)'

# ---- What one types -------------------------------------------------------------------------------------------------

.PHONY: help
help: ## List these targets
	@printf 'make TARGET, where TARGET is one of\n\n'
	@sed -nE 's/^([a-z][a-z-]*):.*## (.*)/\1\t\2/p' $(MAKEFILE_LIST) | while IFS=$$'\t' read -r name text; do \
		printf '  %-14s %s\n' "$$name" "$$text"; done
	@printf '\nSet up a fresh machine and see it run: make demo. Run every check: make test.\n'

.PHONY: demo
demo: setup ## Set everything up and run the load-step scenario into ./demo
	$(call say,gustform simulate $(DEMO_SCENARIO) --out $(DEMO_OUT))
	@$(BIN)/gustform simulate $(DEMO_SCENARIO) --out $(DEMO_OUT)

# The tests on a CAN bus keep one processor busy, much of the rest uses one at a time: side by side they save minutes.
# What they say is shown when the others are through, so that neither hides the progress of the other.
.PHONY: test
test: setup-dev ## All checks, C tests under sanitizers, every Python test, the tests on a CAN bus
	@mkdir -p build; $(MAKE) test-hil >build/test-hil.log 2>&1 & bus=$$!; \
		trap 'kill -TERM $$bus 2>/dev/null || true' EXIT; \
		$(MAKE) test-host || host=$$?; \
		wait $$bus || on_bus=$$?; \
		cat build/test-hil.log; \
		exit $$(($${host:-0} | $${on_bus:-0}))

.PHONY: test-host
test-host: setup-dev ## The same without the tests on a CAN bus
	@$(MAKE) lint
	@$(MAKE) test-c
	@$(MAKE) test-python

.PHONY: check
check: setup-dev ## ruff, mypy --strict, the layers and clang-format: seconds, no tests
	$(call say,ruff)
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --check --quiet . || { echo 'some files are not formatted: make format'; exit 1; }
	$(call say,mypy --strict)
	@$(BIN)/mypy
	$(call say,layers)
	@$(QUIETLY) build/lint-imports.log $(BIN)/lint-imports
	$(call say,files and clang-format)
	@$(BIN)/python tools/check_files.py
	@git ls-files -z '*.c' '*.h' | xargs -0r $(BIN)/clang-format --dry-run -Werror

.PHONY: lint
lint: check ## The quick checks and clang-tidy
	$(call say,clang-tidy)
	@git ls-files -z 'runtime/src/*.c' | xargs -0r -n 1 -P "$$(nproc)" $(BIN)/clang-tidy --quiet -p build/release
	@git ls-files -z 'hil/bridge/src/*.c' 'hil/bridge/tools/*.c' | \
		xargs -0rI@ -P "$$(nproc)" $(BIN)/clang-tidy --quiet @ -- $(BRIDGE_FLAGS) -D_GNU_SOURCE
	@git ls-files -z 'hil/vcan/*.c' 'hil/realtime/*.c' 'hil/pil/*.c' ':!hil/pil/board.c' | \
		xargs -0rI@ -P "$$(nproc)" $(BIN)/clang-tidy --quiet @ -- $(BRIDGE_FLAGS) -DCONTROLLER=dual_port_controller

.PHONY: test-c
test-c: setup-dev ## C tests with AddressSanitizer and UBSan
	$(SET_UP) $(BUILD_STAMPS)/sanitize
	$(call say,C tests under ASan and UBSan)
	@ctest --test-dir build/sanitize --output-on-failure --no-tests=error -j "$$(nproc)"

.PHONY: test-python
test-python: setup-dev ## Python tests on all cores; ARGS=... goes to pytest
	$(call say,Python tests)
	@$(BIN)/python -m pytest -n auto --ignore=tests/hil/vcan $(ARGS)

# The guest of the runner has one processor: these tests run one after the other, and their rigs are made outside.
.PHONY: test-hil
test-hil: setup-dev ## Tests on a real vcan: this kernel's, else one in user-mode Linux; ARGS=... goes to pytest
	$(call say,rigs for the tests on a CAN bus)
	@printf '%s\n' 'fd' 'classic --bus classic' 'scheduled --set wt.schedule.type=CurtailmentSchedule' | \
		$(QUIETLY) build/rigs.log xargs -P 2 -L 1 \
		sh -c 'exec $(BIN)/gustform hil build $(DEMO_SCENARIO) --out build/rigs/"$$0" "$$@"'
	$(call say,tests on a CAN bus)
	@GUSTFORM_RIGS=$(CURDIR)/build/rigs $(BIN)/python hil/vcan/with-vcan $(BIN)/python -m pytest -p no:cacheprovider tests/hil/vcan $(ARGS)

.PHONY: mutate
mutate: setup-dev ## Every mutation of the bridge's supervision, each to be caught by its unit tests
	$(call say,mutations of hil/bridge/src/supervision.c)
	@$(BIN)/python hil/bridge/tests/mutate.py $(ARGS)

.PHONY: fuzz
fuzz: setup-dev ## libFuzzer on decoder, bridge and converter, SECONDS=300 each; what it learns stays in build/fuzz
	$(call say,libFuzzer)
	@GUSTFORM_FUZZ_SECONDS=$(or $(SECONDS),300) $(BIN)/python -m pytest -p no:cacheprovider --timeout=0 tests/fuzz $(ARGS)

.PHONY: bench
bench: setup-dev ## Speed as ratios against a bare program and against CasADi
	@$(BIN)/python -m tests.bench $(ARGS)

.PHONY: pil
pil: setup-dev ## Exported controllers on emulated Cortex-M4F and M7: bits, instructions, memory
	$(call say,gustform hil pil)
	@$(BIN)/gustform hil pil --out build/pil.json $(ARGS)
	@echo build/pil.json

.PHONY: hil-realtime
hil-realtime: setup-dev ## The bridge at 1 kHz in virtual time on an emulated PC, twice; needs Debian's apt
	@tools/system_packages.sh --python $(PYTHON) --realtime
	$(call say,the bridge at 1 kHz in virtual time (a minute or two))
	@$(BIN)/python hil/realtime/realtime.py --json build/realtime.json $(ARGS)
	@echo build/realtime.json

.PHONY: docs
docs: ## Build the documents into docs/_build/html
	$(SET_UP) $(VENV_STAMPS)/docs
	$(call say,documents)
	@$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo docs/_build/html/index.html

.PHONY: format
format: setup-dev ## Format Python and C sources in place
	@$(BIN)/ruff check --fix-only --quiet .
	@$(BIN)/ruff format --quiet .
	@git ls-files -z '*.c' '*.h' | xargs -0r $(BIN)/clang-format -i

.PHONY: setup
setup: ## Only set up what running needs: .venv and the C runtime
	$(SET_UP) $(VENV_STAMPS)/base $(BUILD_STAMPS)/installed

.PHONY: setup-dev
setup-dev: ## Only set up what the tests and checks need
	$(SET_UP) $(VENV_STAMPS)/dev $(BUILD_STAMPS)/installed

.PHONY: hooks
hooks: setup-dev ## Run the quick checks before each git commit (pre-commit)
	@$(BIN)/pre-commit install

.PHONY: wheel
wheel: setup-dev ## Build the wheel, C runtime included, into build/dist
	$(call say,wheel)
	@$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w build/dist .
	@ls build/dist/*.whl

.PHONY: constraints
constraints: ## Pin the newest versions of all Python packages in tools/constraints.txt
	$(call say,newest Python packages)
	@$(PYTHON) -m venv --clear build/constraints
	@build/constraints/bin/python -m pip install --quiet --disable-pip-version-check scikit-build-core
	@build/constraints/bin/python -m pip install --quiet --disable-pip-version-check --no-build-isolation -e '.[dev,docs]'
	@{ sed -n '/^#/p' tools/constraints.txt; build/constraints/bin/python -m pip freeze --all --exclude-editable \
		| grep -viE '^(pip|setuptools|certifi|tzdata)=='; } >build/constraints.txt
	@mv build/constraints.txt tools/constraints.txt

.PHONY: clean
clean: ## Remove what was built; .venv stays
	@rm -rf build docs/_build .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	@rm -rf runtime/gustform_runtime/lib runtime/gustform_runtime/bin runtime/gustform_runtime/include
	@find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

.PHONY: distclean
distclean: clean ## Remove .venv and the demo's results as well
	@rm -rf .venv $(DEMO_OUT) .make.lock

# ---- Set-up ---------------------------------------------------------------------------------------------------------

$(BUILD_STAMPS)/system: tools/system_packages.sh
	$(call say,system packages)
	@tools/system_packages.sh --python $(PYTHON)
	@mkdir -p $(@D) && touch $@

$(BUILD_STAMPS)/system-tests: tools/system_packages.sh $(BUILD_STAMPS)/system
	@tools/system_packages.sh --python $(PYTHON) --tests
	@touch $@

# Order-only: looking at the system again is no reason to make the environment again.
$(VENV_STAMPS)/venv: | $(BUILD_STAMPS)/system
	$(call say,virtual environment $(VENV) from $(PYTHON))
	@$(PYTHON) -m venv --clear $(VENV)
	@mkdir -p $(@D) && touch $@

# Without build isolation, because an isolated build would ask the package index each time.
$(VENV_STAMPS)/base: pyproject.toml tools/constraints.txt $(VENV_STAMPS)/venv
	$(call say,Python packages (about a minute the first time))
	@$(PIP_INSTALL) scikit-build-core
	@$(PIP_INSTALL) --no-build-isolation --editable '.[hil]'
	@touch $@

$(VENV_STAMPS)/dev: $(VENV_STAMPS)/base | $(BUILD_STAMPS)/system-tests
	$(call say,Python packages for tests and checks (about a minute the first time))
	@$(PIP_INSTALL) --no-build-isolation --editable '.[dev]'
	@touch $@

$(VENV_STAMPS)/docs: $(VENV_STAMPS)/base
	$(call say,Python packages for the documents)
	@$(PIP_INSTALL) --no-build-isolation --editable '.[docs]'
	@touch $@

# CMake configures anew only when one of its files changed or the tree was made in another place; Ninja sees to the rest.
$(BUILD_STAMPS)/release-configured: $(C_CONFIGURATION) | $(BUILD_STAMPS)/system
	@$(QUIETLY) build/release.log cmake --fresh -S . -B build/release -G Ninja -DCMAKE_BUILD_TYPE=Release \
		-DGUSTFORM_TESTS=OFF
	@touch $@

# Installed beside its Python package, where the editable install finds it.
$(BUILD_STAMPS)/installed: $(BUILD_STAMPS)/release-configured $(RUNTIME_SOURCES)
	$(call say,C runtime)
	@$(QUIETLY) build/release.log cmake --build build/release --parallel
	@$(QUIETLY) build/release.log cmake --install build/release --prefix runtime
	@touch $@

$(BUILD_STAMPS)/sanitize-configured: $(C_CONFIGURATION) | $(BUILD_STAMPS)/system-tests
	@$(QUIETLY) build/sanitize.log cmake --fresh -S . -B build/sanitize -G Ninja -DCMAKE_BUILD_TYPE=Debug \
		-DGUSTFORM_TESTS=ON -DGUSTFORM_SANITIZE=ON
	@touch $@

$(BUILD_STAMPS)/sanitize: $(BUILD_STAMPS)/sanitize-configured $(RUNTIME_SOURCES) $(TEST_SOURCES)
	$(call say,C runtime and bridge and their tests with ASan and UBSan)
	@$(QUIETLY) build/sanitize.log cmake --build build/sanitize --parallel
	@touch $@
