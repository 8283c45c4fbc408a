# Everything sets itself up: `make dataset` and `make test` work on a fresh machine with Python >= 3.11 and make.
SHELL := /bin/sh
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help system install trainer dataset test test-gpu check schema docs-accuracy front bench clean

VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/installed.stamp
WHOLE := $(VENV)/installed-whole.stamp
SPEC ?= scene_specs/3df-lighting-mini.yaml
OUT ?= datasets/$(basename $(notdir $(SPEC)))
ARGS ?=

help:  ## list what make can do
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):[^#]*## ?/  make \1\t/' | expand -t 18
	@echo '  SPEC=FILE OUT=DIR ARGS="..." choose what `make dataset` builds; ARGS also go to pytest and the benchmarks'

system:  ## the system libraries that wheels do not carry: libLLVM and what Open3D is linked with
	@sh tools/system_libs.sh

install: $(STAMP)  ## the virtual environment in .venv, with locked packages

# The stamp comes last, so that an interrupted installation is taken up again.
$(STAMP): pyproject.toml constraints.txt tools/make_venv.sh dataset_builder/__init__.py | system
	@sh tools/make_venv.sh $(VENV) build,denoise,gltf,look,remote,study,usd
	@touch $@

trainer: $(WHOLE)  ## what training, tests and checks need besides, PyTorch above all

$(WHOLE): $(STAMP)
	@sh tools/make_venv.sh $(VENV) test
	@touch $@

dataset: $(STAMP)  ## build SPEC (the mini dataset) into OUT
	@$(VENV)/bin/dataset-builder build $(SPEC) --out $(OUT) $(ARGS)

test: $(WHOLE)  ## all tests, a process for each core; ARGS="-n 0" for one process
	@$(PY) -m pytest -n auto $(ARGS)

test-gpu: $(WHOLE)  ## what needs an NVIDIA GPU; skipped where there is none
	@$(PY) -m pytest -m gpu tests/gpu $(ARGS)

check: $(WHOLE)  ## lint and types
	@$(PY) -m ruff check .
	@$(PY) -m mypy

schema: $(WHOLE)  ## write the JSON Schemas that editors read and the tables of docs/specs.md and docs/label.md, after a change of the models
	@$(PY) tools/export_schema.py
	@$(PY) tools/spec_tables.py

docs-accuracy: $(WHOLE)  ## the study behind docs/accuracy.md, and its tables, figures and numbers; on an idle machine
	@$(VENV)/bin/dataset-builder study accuracy scene_specs/3df-lighting-mini.yaml --budget medium --examples 2 \
		--set 'image={width: 64, height: 64}' --error i_t=0.05 s_prime=0.05 i_s=0.05 --count 12000 \
		--out studies/docs-accuracy $(ARGS)
	@PYTHONPATH=. $(PY) tools/accuracy_docs.py studies/docs-accuracy

front:  ## the libraries that pages carry, pinned in tools/front, into report/front/vendor; needs Node and npm
	@python3 tools/vendor_front.py

bench: $(WHOLE)  ## the claims of the README, as ratios from one run each
	@set -e; for file in benchmarks/[a-z]*.py; do echo "== $$file"; $(PY) "$$file" $(ARGS); done

clean:  ## remove the virtual environment and caches; datasets stay
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find dataset_builder tests benchmarks tools -name __pycache__ -type d -prune -exec rm -rf {} +
