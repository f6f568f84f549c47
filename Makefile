# Everything a developer or a user runs. Needs Python 3.11+, a Rust toolchain, make and a C compiler; the rest is fetched.
PYTHON ?= python3
UV = .tools/bin/uv
RUN = $(UV) run --frozen
UV_VERSION = 0.13.8
FUZZ_SECONDS ?= 600
FUZZ_SEED ?= 1
# A panic names its source file: in a wheel without the folders of who built it.
NAMELESS = --remap-path-prefix=$(or $(CARGO_HOME),$(HOME)/.cargo)=/cargo --remap-path-prefix=$(CURDIR)=/pomona
# Where robots live: Jetson, Raspberry Pi. Zig links against the C library of a Linux as old as this.
ROBOT = aarch64-unknown-linux-gnu
ROBOT_LIBC = manylinux2014

.DEFAULT_GOAL := help
.PHONY: all install develop page demo animation test test-rust test-python lint format bench experiments fuzz audit wheel docs clean help

all: lint docs test ## what CI runs

$(UV):
	$(PYTHON) -m venv .tools
	.tools/bin/python -m pip install --quiet uv==$(UV_VERSION)

# Inexact, so that what `make docs` installed stays.
install: $(UV) ## build pomona and install it with its tools into .venv
	$(UV) sync --frozen --inexact

develop: $(UV) ## rebuild the extension in place after an edit of Rust sources, fast (dev profile)
	PATH="$(CURDIR)/.tools/bin:$$PATH" $(UV) run --no-sync maturin develop --uv --skip-install

page: ## rebuild the page of `view` and `report` out of web/, with Node
	cd web && npm ci && npm run build

demo: install ## the whole story in three minutes: three recordings of a row, one map, growth, a report to open
	$(RUN) pomona demo examples/row

test: test-rust test-python ## all tests

test-rust: ## the core's tests
	cargo test --workspace --locked

test-python: install ## the tests of the Python face and the command line
	$(RUN) pytest --numprocesses auto --maxprocesses 4 --dist loadfile

lint: install ## formatting, clippy, the core's pages, ruff, mypy and the stubs of the extension
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) mypy
	$(RUN) stubtest pomona._core --mypy-config-file pyproject.toml

format: install ## rewrite the sources in the house's format
	cargo fmt --all
	$(RUN) ruff check --fix .
	$(RUN) ruff format .

animation: demo ## the animation at the top of the README, out of the demo; needs chromium
	$(RUN) python examples/animation.py out/demo

bench: install ## accuracy and speed; writes benchmarks/results
	$(RUN) python -m benchmarks

experiments: install ## the paper's experiments on rendered videos, kept in out/experiments; writes docs/experiments.md
	$(RUN) python -m benchmarks.experiments

fuzz: install ## damaged input for every reader and binding, FUZZ_SECONDS=600; what fails lies in out/fuzz
	$(RUN) python -m fuzz --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED)

audit: install ## licences of all dependencies, and advisories as far as they can be fetched
	$(RUN) python -m audit

wheel: install ## wheels for others and for robots (ARM, built but not run), into dist/, looked at before they are called done
	RUSTFLAGS="$(NAMELESS)" $(RUN) maturin build --release --locked --out dist
	rustup target add $(ROBOT)
	RUSTFLAGS="$(NAMELESS)" $(RUN) --group wheel maturin build --release --locked --out dist \
		--target $(ROBOT) --zig --compatibility $(ROBOT_LIBC)
	$(RUN) python -m audit.wheel dist

docs: $(UV) ## the documentation site, into site/
	NO_MKDOCS_2_WARNING=1 $(UV) run --frozen --group docs mkdocs build --strict

clean: ## remove what was built
	rm -rf .venv .tools site target out dist

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "%-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
