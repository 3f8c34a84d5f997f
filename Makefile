# Every target makes its own set-up from a fresh clone: cargo, CPython >= 3.11 and a C compiler are enough.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.built
DEPENDENCIES := $(VENV)/.dependencies

# Compiled crates are shared between the extension module and the Rust tests.
CARGO_FLAGS := --workspace --release
SOURCES := $(shell find rust -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock pyproject.toml

.DEFAULT_GOAL := help
.PHONY: help build quick demo test test-rust test-python fuzz audit lint docs site wheel bench clean

help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

build: $(STAMP) ## Make .venv and build the package into it

# The demonstration needs what a user needs; the development tools come with the first target that uses them.
USED := $(VENV)/.used

$(USED): $(DEPENDENCIES) $(SOURCES)
	@echo 'make: builds the Rust core and installs imufit without development tools into $(VENV) (some minutes)'
	. $(BIN)/activate && PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 maturin develop --release --quiet
	touch $@

quick: $(DEPENDENCIES) ## After an edit of Rust: build only what changed, with little optimisation, for tests
	. $(BIN)/activate && PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 maturin develop --profile dev --quiet

demo: $(USED) ## The whole loop on a log with a hidden effect; report in demo/
	$(BIN)/imufit demo -o demo

test: test-rust test-python ## Rust and Python tests

test-rust: ## Rust tests
	cargo test $(CARGO_FLAGS) --exclude imufit-py --quiet

test-python: $(STAMP) ## Python tests
	$(BIN)/python -m pytest -n 2 --dist loadfile

# A frame or a line is a few ten bytes; no sanitizer, since there is no unsafe code for it to watch.
FUZZ_FLAGS := --sanitizer none --fuzz-dir rust/device/fuzz
# 0: other inputs each time; .ci/run puts the same ones, so that it fails by a change and not by chance.
FUZZ_SEED := 0
FUZZ_LIMITS := -max_total_time=45 -rss_limit_mb=512 -max_len=4096 -seed=$(FUZZ_SEED)

fuzz: $(STAMP) ## Any bytes for all decoders and readers, four minutes; installs cargo-fuzz and atheris
	cargo fuzz --version >/dev/null 2>&1 || cargo install cargo-fuzz --locked --quiet
	for target in frames lines; do cargo fuzz run $(FUZZ_FLAGS) $$target -- $(FUZZ_LIMITS) || exit 1; done
	$(BIN)/python -c 'import atheris' 2>/dev/null || $(BIN)/python -m pip install --quiet 'atheris>=3,<4'
	$(BIN)/python tests/fuzz/readers.py --seconds 90 --seed $(FUZZ_SEED)

audit: $(STAMP) ## Known weaknesses, licences and sources of what imufit is built on; advisories need the network
	cargo deny --version >/dev/null 2>&1 || cargo install cargo-deny --locked --quiet
	cargo deny check licenses bans sources
	cargo deny check advisories
	$(BIN)/pip-audit --version >/dev/null 2>&1 || $(BIN)/python -m pip install --quiet 'pip-audit>=2.7,<3'
	$(BIN)/pip-audit --local --skip-editable --progress-spinner off

lint: $(STAMP) ## Formatting, clippy, ruff, mypy, stubs, import layers
	cargo fmt --all --check
	rustfmt --check --edition 2024 rust/device/fuzz/fuzz_targets/*.rs
	cargo clippy $(CARGO_FLAGS) --all-targets -- -D warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest imufit._imufit
	$(BIN)/lint-imports

docs: $(STAMP) ## Refresh what the documents take from the code (effects, glossary, pictures, pasted output), build the site
	$(BIN)/python docs/make_effects.py
	$(BIN)/python docs/make_glossary.py
	$(BIN)/python docs/make_filters.py
	$(BIN)/python docs/pictures/make.py
	$(BIN)/python examples/notebooks/make.py
	$(BIN)/python docs/blocks.py --write
	$(BIN)/python rust/make_licences.py
	$(MAKE) --no-print-directory site

site: $(STAMP) ## The documents as pages in site/; a warning is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

wheel: $(DEPENDENCIES) ## One abi3 wheel in dist/
	$(BIN)/maturin build --release --out dist

bench: $(STAMP) ## Speed and accuracy against other packages
	cargo bench --workspace --exclude imufit-py
	for file in benches/*.py; do if [ -f "$$file" ]; then $(BIN)/python "$$file" || exit 1; fi; done

clean: ## Remove what was built
	rm -rf $(VENV) target dist demo site

# The build backend and the development tools are named in pyproject.toml, and only there.
$(DEPENDENCIES): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "imufit needs CPython 3.11 or newer: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'maturin>=1.13,<2'
	touch $@

$(STAMP): $(DEPENDENCIES) $(SOURCES)
	@echo 'make: builds the Rust core and installs imufit with its development tools into $(VENV) (some minutes)'
	. $(BIN)/activate && PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 maturin develop --release --extras dev,docs --quiet
	touch $@ $(USED)
