# make run, make test, make check, make build, make bench: each makes the virtual environment first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
JOBS ?= 2

.PHONY: play run build test check bench pages picture docs release update fuzz coverage soak clean

play: $(VENV)/.installed-play
	$(BIN)/gyrotwin play

run: $(VENV)/.installed
	$(BIN)/gyrotwin run constant --out results/constant

build: $(VENV)/.installed
	$(BIN)/gyrotwin build

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --max-worker-restart 0

check: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks

# Needs clang: apt-get install clang.
FUZZ_SECONDS ?= 300
fuzz: $(VENV)/.installed-dev
	$(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS) --jobs $(JOBS)
	$(BIN)/python -m tests.fuzz.sanitize

# Needs gcov, which comes with gcc.
coverage: $(VENV)/.installed-dev
	$(BIN)/python -m tests.fuzz.coverage --missed

soak: $(VENV)/.installed-dev
	$(BIN)/python -m tests.soak

update: $(VENV)/.installed-dev
	$(BIN)/python build_fmu.py --update

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "gyrotwin needs Python 3.11 or newer: make PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	touch $@

$(VENV)/.installed-play: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[zig]'
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) dist results

pages: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.pages build/pages

picture: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.play_picture docs/play.png

docs: $(VENV)/.installed-dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	$(BIN)/python -m mkdocs build --strict --site-dir build/site

# Wheel and source with docs/ and tests, each with its SHA-256.
release: $(VENV)/.installed-dev
	rm -rf build/release
	$(BIN)/python -m pip install --quiet --disable-pip-version-check hatchling
	$(BIN)/python -m hatchling build -d build/release
	$(BIN)/python -c 'import hashlib, pathlib; f = sorted(pathlib.Path("build/release").iterdir()); pathlib.Path("build/release/SHA256SUMS").write_text("".join(f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.name}\n" for p in f))'
	cat build/release/SHA256SUMS
