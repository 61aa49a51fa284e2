# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# `make demo` and `make test` on a machine with only Python 3.11 or 3.12. The first call creates a
# virtual environment with the pinned packages; later calls use it.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
REQUIREMENTS := requirements/development.txt requirements/lock.txt pyproject.toml setup.py setup.cfg
# On a terminal pip shows its progress: gigabytes may take a quarter of an hour. Logs stay short.
PIP_QUIET := $(if $(MAKE_TERMOUT),,-qq)
PYTEST_ARGS ?=
# Processes that share the test files. A file stays in one process, with its nodes and fixtures.
TEST_PROCESSES ?= 2

# The ROS 2 wheels of the environment and a sourced ROS 2 must not be used in one process, because it
# is undefined which libraries are loaded. A sourced ROS 2 is therefore hidden from everything that
# this file runs. Use `colcon build` to build for it; see README.md.
ROS_VARIABLES := AMENT_PREFIX_PATH AMENT_CURRENT_PREFIX COLCON_PREFIX_PATH CMAKE_PREFIX_PATH \
  PYTHONPATH LD_LIBRARY_PATH ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION ROS_DOMAIN_ID \
  ROS_AUTOMATIC_DISCOVERY_RANGE ROS_STATIC_PEERS RMW_IMPLEMENTATION
ifneq ($(strip $(AMENT_PREFIX_PATH)$(ROS_DISTRO)),)
$(info A ROS 2 environment is sourced ($(or $(ROS_DISTRO),$(AMENT_PREFIX_PATH))): make ignores it and uses the pinned ROS 2 Jazzy wheels in $(VENV); `colcon build` uses the sourced one.)
endif
ifneq ($(VIRTUAL_ENV),)
unexport VIRTUAL_ENV
endif
unexport $(ROS_VARIABLES) PYTHONHOME

RUNS ?= runs
SIMULATED := $(RUNS)/simulated
TRAIN_ARGS ?=
FUZZ_ARGS ?=
SOAK_ARGS ?=

.PHONY: help demo small docs docs-serve test numerics interruption fuzz soak benchmark default data-given interfaces check lint types format environment clean distclean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/' | expand -t 14

demo: $(STAMP) ## play a recording through the real node and score the predictions; DATA=DIR LAYOUT=ind [RECORDINGS="04 16"] [ALL=1] [OUTPUT=DIR]
	@$(BIN)/mtpgo demo $(if $(DATA),"$(DATA)") $(if $(LAYOUT),--layout "$(LAYOUT)") \
	  $(if $(RECORDINGS),--recordings $(RECORDINGS)) $(if $(ALL),--all) \
	  $(if $(OUTPUT),--output "$(OUTPUT)") $(DEMO_ARGS)

small: $(STAMP) ## install the wheel with the extra `ros` alone into .venv-small, print its size and play the demo
	@$(BIN)/python test/small/run_small.py .venv-small

test: check ## run ruff, mypy and pytest
	@echo "== pytest"
	@$(BIN)/python -m pytest -n $(TEST_PROCESSES) --dist loadfile $(PYTEST_ARGS)

# PyTorch without vector instructions rounds differently, as another CPU does. No test may depend on
# the last digits.
NUMERICAL_TESTS := test/models test/mtpgo_training/training test/mtpgo_training/export

numerics: $(STAMP) ## run the numerical tests as on a CPU without AVX
	@echo "== pytest, ATEN_CPU_CAPABILITY=default"
	@ATEN_CPU_CAPABILITY=default $(BIN)/python -m pytest -n $(TEST_PROCESSES) --dist loadfile \
	  $(NUMERICAL_TESTS)

interruption: $(STAMP) ## kill training, conversion, cache, export and record at random moments; KILLS=N times each (20)
	@MTPGO_KILLS=$(or $(KILLS),20) $(BIN)/python -m pytest test/interruption $(PYTEST_ARGS)

fuzz: $(STAMP) ## feed damaged messages, streams and files to every reader; SECONDS=N of all targets together (600)
	@$(BIN)/python -m pip install -qq --disable-pip-version-check -r requirements/fuzz.txt \
	  || echo "atheris is not available here: the inputs are mutated without looking at coverage"
	@$(BIN)/python test/fuzz/run_fuzz.py --seconds $(or $(SECONDS),600) $(FUZZ_ARGS)

soak: $(STAMP) ## run the node for a long time and measure what it keeps; SECONDS=N of predicting (1800)
	@$(BIN)/python test/soak/run_soak.py --seconds $(or $(SECONDS),1800) $(SOAK_ARGS)

# Prints the tables of docs/performance.md, each with its command and the machine, then tests the
# speed ratios.
benchmark: $(STAMP) ## print the speed tables of docs/performance.md and test the speed ratios; takes half an hour
	@$(BIN)/mtpgo benchmark latency --threads 1 2
	@echo; $(BIN)/mtpgo benchmark node --agents 32 64 --model default
	@echo; $(BIN)/mtpgo benchmark largest
	@echo; $(BIN)/mtpgo benchmark largest --graph each --neighbours 8
	@echo; $(BIN)/mtpgo benchmark growth
	@echo; $(BIN)/mtpgo benchmark trails
	@echo; $(BIN)/mtpgo benchmark conversion
	@echo; $(BIN)/mtpgo benchmark training
	@echo; $(BIN)/mtpgo benchmark node --bars
	@echo; $(BIN)/python -m pytest benchmarks --benchmark-columns=median,rounds

DEFAULT_REAL := ngsim ngsim_i80 juelich_corridors madras_lyon tgsim_pairs_1d
DEFAULT_SIMULATED := roundabout street curves junctions roundabouts crowd ramps highway_free highway_dense
DEFAULT_DATA = $(foreach name,$(DEFAULT_REAL),--data "$(DATA)/$(name)" --layout ind) \
	  $(foreach name,$(DEFAULT_SIMULATED),--data "$(SIMULATED)/$(name)" \
	  --layout $(if $(filter highway%,$(name)),highd,ind))

# The shipped model `default`, in four stages. The first begins with random weights on half of the
# sites; the others go on from them, with losses of their own. All are done without each half of the
# sites, which the covariances and weights are calibrated on and the card's figures are of (crossval),
# and with all sites (train).
THIRD_STAGE := --set optimisation.epochs=6 --set optimisation.consistency_weight=0
SECOND_STAGE := $(THIRD_STAGE) --set optimisation.heaviest_weight=1 --set optimisation.huber_delta=1 \
  --set optimisation.mean_weight=0.5
FIRST_STAGE := $(THIRD_STAGE) --set optimisation.warm_up_share=0.25 --set optimisation.learning_rate=0.0025 \
  --set optimisation.heaviest_weight=0 --set optimisation.huber_delta=1 --set optimisation.mean_weight=0.5
DEFAULT_CROSSVAL = $(BIN)/mtpgo crossval default --folds first_half second_half --jobs 2 $(DEFAULT_DATA)
DEFAULT_TRAIN = $(BIN)/mtpgo train default $(DEFAULT_DATA) $(TRAIN_ARGS)
goes_on = $(if $(wildcard $(RUNS)/$(1)/last.pt),--resume,--init-from "$(RUNS)/$(2)") --out "$(RUNS)/$(1)"
default: data-given $(STAMP) $(DEFAULT_SIMULATED:%=$(SIMULATED)/.%) ## train, calibrate and export the shipped model `default`; DATA=DIR of the real recordings [RUNS=DIR]
	@$(DEFAULT_CROSSVAL) --out "$(RUNS)/default-crossval-1" --steps-per-fold 1200 $(FIRST_STAGE)
	@$(DEFAULT_CROSSVAL) --out "$(RUNS)/default-crossval-2" $(SECOND_STAGE) \
	  --init-from "$(RUNS)/default-crossval-1"
	@$(DEFAULT_CROSSVAL) --out "$(RUNS)/default-crossval-3" --seed 2 $(THIRD_STAGE) \
	  --init-from "$(RUNS)/default-crossval-2"
	@$(DEFAULT_CROSSVAL) --out "$(RUNS)/default-crossval" --seed 3 \
	  --init-from "$(RUNS)/default-crossval-3"
	@$(DEFAULT_TRAIN) $(SECOND_STAGE) $(call goes_on,default-1,default-crossval-2/folds/first_half/run)
	@$(DEFAULT_TRAIN) $(THIRD_STAGE) --set optimisation.epochs=4 --seed 2 $(call goes_on,default-2,default-1)
	@$(DEFAULT_TRAIN) --seed 3 $(call goes_on,default,default-2)
	@$(BIN)/mtpgo export "$(RUNS)/default" -o "$(RUNS)/default.pt" \
	  --checkpoint "$(RUNS)/default.ckpt" --calibration "$(RUNS)/default-crossval"

data-given:
	@for name in $(DEFAULT_REAL); do test -d "$(DATA)/$$name" || { echo "make: DATA is '$(DATA)', which \
	has no directory $$name; expected the one that holds $(DEFAULT_REAL): make default DATA=DIR" \
	  >&2; exit 2; }; done

$(SIMULATED)/.highway_free: SIMULATE := highway --traffic free --count 6 --seconds 180 --seed 100
$(SIMULATED)/.highway_dense: SIMULATE := highway --traffic dense --count 6 --seconds 180 --seed 200
$(SIMULATED)/.roundabout: SIMULATE := roundabout --count 4 --seconds 180 --seed 1
$(SIMULATED)/.street: SIMULATE := street --count 9 --seconds 180 --seed 1
$(SIMULATED)/.curves: SIMULATE := curves --count 8 --seconds 120 --seed 1
$(SIMULATED)/.junctions: SIMULATE := junctions --count 10 --seconds 120 --seed 1
$(SIMULATED)/.roundabouts: SIMULATE := roundabouts --count 8 --seconds 120 --seed 1
$(SIMULATED)/.crowd: SIMULATE := crowd --count 4 --seconds 120 --seed 1
$(SIMULATED)/.ramps: SIMULATE := ramps --count 8 --seconds 120 --seed 1
$(SIMULATED)/.%: | $(STAMP)
	@$(BIN)/mtpgo simulate $(SIMULATE) -o "$(SIMULATED)/$*" --overwrite
	@touch $@

docs: $(STAMP) ## build the documentation site in build/site
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "Built build/site: open build/site/index.html, or make docs-serve"

docs-serve: $(STAMP) ## show the documentation site at http://127.0.0.1:8000, built again at every change
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs serve

interfaces: $(STAMP) ## fetch the message definitions of Autoware, CARLA and vision_msgs, for the tests of the recipes
	@$(BIN)/python test/recipes/interface_files.py

check: lint types

lint: $(STAMP) ## run ruff: lint rules and format
	@echo "== ruff"
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(STAMP) ## run mypy
	@echo "== mypy"
	@$(BIN)/mypy

format: $(STAMP) ## let ruff fix and format the code
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

environment: $(STAMP) ## only install the virtual environment

$(STAMP): $(REQUIREMENTS)
	@python=""; \
	for candidate in $(PYTHON) python3 python3.12 python3.11; do \
	  if "$$candidate" -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' \
	    2>/dev/null; then python="$$candidate"; break; fi; \
	done; \
	if [ -z "$$python" ]; then \
	  echo "make: no Python 3.11 or 3.12 was found as python3, python3.12 or python3.11;" \
	    "install one or give its path: make PYTHON=/path/to/python3.12" >&2; exit 2; \
	fi; \
	if ! "$$python" -c 'import ensurepip, venv' 2>/dev/null; then \
	  echo "make: $$("$$python" --version) does not have the module venv;" \
	    "on Debian and Ubuntu install the package python3-venv" >&2; exit 2; \
	fi; \
	echo "== Setting up $(VENV) with $$("$$python" --version): a virtual environment and the pinned" \
	  "packages (once; 2 GB, or 6 GB where pip takes PyTorch with CUDA; some minutes)"; \
	"$$python" -m venv "$(VENV)"
	@echo "== Installing requirements/development.txt"
	@$(BIN)/python -m pip install $(PIP_QUIET) --disable-pip-version-check \
	  -r requirements/development.txt -c requirements/lock.txt
	@echo "== Installing this package (editable)"
	@$(BIN)/python -m pip install -qq --disable-pip-version-check \
	  --no-deps --no-build-isolation --editable .
	@touch $@
	@echo "== $(VENV) is ready"

clean: ## remove builds, demo output and caches; keep the environment
	@rm -rf build install log dist demo_output *.egg-info .pytest_cache .mypy_cache .ruff_cache
	@find . -name __pycache__ -not -path './.venv*' -prune -exec rm -rf {} +
	@echo "Removed build, install, log, dist, demo_output and caches; $(VENV) stays (make distclean)."

distclean: clean ## also remove the environment
	@rm -rf "$(VENV)"
