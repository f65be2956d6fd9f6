PYTHON ?= $(firstword $(shell command -v python3.11 python3))
BIN := .venv/bin
INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
SUITE = $(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder
STAMP := .venv/installed
COMPILED := .venv/compiled
KERNELS := solver/rolling/kernels.py solver/fatigue/kernels.py solver/fem/kernels.py
OWN := examples/own_back_stress.py:examples/own_curve.py:examples/own_friction.py:examples/own_yield_surface.py
DENO = DENO_DIR=.venv/deno DENO_NO_UPDATE_CHECK=1 $(BIN)/deno

# Python keeps what it has compiled, whatever the caller says: tests and studies start many processes.
export PYTHONDONTWRITEBYTECODE :=

MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup run check test serve lint docs gallery measured bench stress stress-service lock sbom clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(STAMP) $(COMPILED) ## make the environment .venv, or bring it up to date

run: setup ## compute a first study in seconds, then the 45 runs of the punch, into out/
	$(BIN)/residua run data/studies/tour.toml --out out
	$(BIN)/residua run data/studies/punch.toml --out out

check: setup ## check style and types, and run the tests that compute nothing (90 s)
	@$(MAKE) lint
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile -m "not solves and not processes and not pages and not long"

test: setup ## run all tests but the long ones on all cores
	$(SUITE) --durations=15 -m "not long"

serve: setup ## start the HTTP service
	$(BIN)/residua serve

lint: setup ## check style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers auto
	@$(DENO) check --quiet --config tests/architecture/deno.json service/pages/static/*.js
	@$(DENO) lint --quiet --config tests/architecture/deno.json service/pages/static

docs: setup ## write the reference of the public names as HTML into build/docs
	$(BIN)/python -W error docs/reference/api.py build/docs

gallery: setup ## compute and draw the pictures of docs/gallery.md that take minutes
	$(BIN)/python docs/pictures/make.py

measured: setup ## compute, compare and draw what stands in docs/measured.md (8 minutes of processor time)
	$(BIN)/python docs/pictures/measured.py

bench: setup ## draw CPU time against error
	$(BIN)/python -m tests.benchmarks

stress: setup ## run the long tests and 2229 seeded scenes, and see that none is answered wrongly (hours)
	$(SUITE) -m long
	$(BIN)/python -m tests.stability.estimates 39
	$(BIN)/python -m tests.stability
	RESIDUA_PARTS=$(OWN) $(BIN)/python -m tests.stability.slopes

stress-service: setup ## put the service under stress, and see what it stands (15 minutes)
	$(BIN)/python -m tests.stress

lock: setup ## pin what the image installs, with digests, as constraints.txt has it
	$(BIN)/python docker/lock.py

sbom: ## list what the image installs as build/sbom.json (CycloneDX)
	$(PYTHON) -m venv build/sbom
	build/sbom/bin/python -m pip install --quiet --disable-pip-version-check cyclonedx-bom==7.5.0
	build/sbom/bin/cyclonedx-py requirements requirements.lock --pyproject pyproject.toml \
		--output-reproducible --of JSON -o build/sbom.json

clean: ## remove the environment and caches; results in out/ stay
	rm -rf .venv build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find solver studies service residua tests -name __pycache__ -prune -exec rm -rf {} +

# A new environment has the pip and the setuptools of the day when its Python was built. Of the
# libraries' 11,000 modules a third are ever imported: the next rule compiles these, not all for 40 s.
$(STAMP): pyproject.toml constraints.txt $(BIN)/python
	$(INSTALL) pip setuptools
	$(INSTALL) --no-compile --no-build-isolation --editable '.[dev,docs,mkl,parquet,zarr]'
	@touch $@

# Else the first run that needs a kernel would wait for the compiler, for 13 s.
$(COMPILED): $(STAMP) $(KERNELS)
	echo $(subst /,.,$(KERNELS:.py=)) studies.execution.run service.app | xargs -n 1 -P 2 sh -c '$(BIN)/python -c "import $$0"'
	@touch $@

$(BIN)/python:
	$(PYTHON) -m venv --clear .venv
