# Everything sets itself up: `make demo` and `make test` need git, make and Python >= 3.11, nothing else.
# Python 3.11 is preferred because PyBullet has no wheel for later ones.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
PIP_INSTALL := PIP_CONSTRAINT=$(CURDIR)/constraints.txt $(BIN)/python -m pip install --quiet --disable-pip-version-check

# Every command that a test runs would compile Pliant anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo app-demo test test-all fuzz metamorphic soak mutants lint types imports check bench bench-laws bench-surrogates bench-families bench-physics bench-grasp bench-tasks bench-evidence bench-real bench-files bench-install study-shape study-gripper study-reach docs freeze clean

demo: $(VENV)/.run  ## FEM → law → finger in three engines → report
	$(BIN)/pliant run examples/first_finger/finger.yaml --out runs/first-finger
	$(BIN)/pliant run examples/first_finger/loaded.yaml --out runs/loaded-finger

# Two workers of a thread each; loops that both need are compiled before.
test test-all: export OMP_NUM_THREADS := 1
test test-all: export OPENBLAS_NUM_THREADS := 1
test test-all: export MKL_NUM_THREADS := 1
PYTEST := $(BIN)/python -m tests.compile_first && $(BIN)/python -m pytest -n 2 --dist loadfile

test: $(VENV)/.dev  ## the fast suite: every room and every guarantee has a test in it
	$(PYTEST) --no-loadscope-reorder

test-all: $(VENV)/.dev  ## every test, those marked slow too
	$(PYTEST) --no-loadscope-reorder -m "" --durations 25

fuzz: $(VENV)/.dev  ## 50 000 damaged inputs against every reader; what breaks one is kept in tests/fuzz/finds
	$(BIN)/python -m tests.fuzz.run --cases 50000 $(FUZZ)

metamorphic: $(VENV)/.dev  ## 5 000 random studies and recordings: answers change as physics requires; every key of every example; an hour
	PLIANT_METAMORPHIC=500 $(BIN)/python -m pytest -q tests/metamorphic

soak: $(VENV)/.dev  ## an hour of sweeps, a search and diagnoses on one store, killed and starved at random; every answer is compared
	$(BIN)/python -m benchmarks.soak

mutants: $(VENV)/.dev  ## whether the tests notice wrong code: hours, resumable
	$(BIN)/python -m tests.mutants.run $(MUTANTS)

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy

imports: $(VENV)/.dev  ## who may import whom
	$(BIN)/lint-imports
	$(BIN)/python -m benchmarks.house --circles

check: lint types imports test  ## what CI runs, with the fast tests alone

app-demo: $(VENV)/.dev  ## a user of the evidence page in headless Chromium; pictures in runs/app-demo
	$(BIN)/python -m pytest -m "" -q tests/app/test_in_the_browser.py

bench: bench-laws bench-physics bench-grasp  ## the figures of docs and notes, as JSON in benchmarks/out

bench-laws: $(VENV)/.run  ## FEM and joint laws
	$(BIN)/python -m benchmarks.fem_bending
	$(BIN)/python -m benchmarks.law_error

bench-surrogates: $(VENV)/.dev  ## laws and meta-models: accuracy on states and designs left out, error bars, few states, speed: an hour; the published tables stand in ../shared/data/reference
	$(BIN)/python -m benchmarks.surrogates.laws
	$(BIN)/python -m benchmarks.surrogates.speed
	$(BIN)/python -m benchmarks.surrogates.states
	$(BIN)/python -m benchmarks.surrogates.three_axes
	$(BIN)/python -m benchmarks.surrogates.elsewhere
	$(BIN)/python -m benchmarks.surrogates.designs
	$(BIN)/python -m benchmarks.surrogates.gain

bench-families: $(VENV)/.run  ## FEM of the families against published curves, a second code, finer meshes, sweeps: hours; the published tables stand in ../shared/data/reference
	$(BIN)/python -m benchmarks.families.elements
	$(BIN)/python -m benchmarks.families.second_solver
	$(BIN)/python -m benchmarks.families.bending
	$(BIN)/python -m benchmarks.families.helical
	$(BIN)/python -m benchmarks.families.translational
	$(BIN)/python -m benchmarks.families.tendon_joint --sensitivity
	$(BIN)/python -m benchmarks.families.tendon_finger
	$(BIN)/python -m benchmarks.families.several_chambers
	$(BIN)/python -m benchmarks.families.fibre_reinforced
	$(BIN)/python -m benchmarks.families.sampling --helical
	$(BIN)/python -m benchmarks.families.fem_speed --pairs 1
	$(BIN)/python -m benchmarks.families.gripper_designs
	$(BIN)/python -m benchmarks.families.chain_hypothesis
	$(BIN)/python -m benchmarks.families.kill
	$(BIN)/python -m benchmarks.families.sweep

bench-physics: $(VENV)/.bench  ## engines, the published baseline and a Cosserat rod on the published helix
	$(BIN)/python -m benchmarks.engines_agree
	$(BIN)/python -m benchmarks.physics.engines
	$(BIN)/python -m benchmarks.physics.rod
	$(BIN)/python -m benchmarks.physics.closed_paths
	$(BIN)/python -m benchmarks.physics.designs
	$(BIN)/python -m benchmarks.physics.scaling
	$(BIN)/python -m benchmarks.physics.ablation

bench-tasks: $(VENV)/.run  ## tasks among obstacles: speed against plain MuJoCo, agreement of the engines
	$(BIN)/python -m benchmarks.tasks.speed

bench-grasp: $(VENV)/.run  ## grasps: speed, holding limits and creep, the measured table
	$(BIN)/python -m benchmarks.grasp.speed
	$(BIN)/python -m benchmarks.grasp.holding
	$(BIN)/python -m benchmarks.grasp.experiment

bench-evidence: $(VENV)/.run  ## a sealed run: effects hidden for this code, diagnosed and judged; resumable
	$(BIN)/python -m benchmarks.evidence.run_bench --sealed
	$(BIN)/python -m benchmarks.evidence.speed
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.evidence.coverage

bench-real: $(VENV)/.run  ## measurements of real hardware in ../shared/data; half an hour, resumable
	$(BIN)/python -m benchmarks.real.two_bellow
	$(BIN)/python -m benchmarks.real.tentacle
	$(BIN)/python -m benchmarks.real.elastomer
	$(BIN)/python -m benchmarks.real.grasp_counts
	$(BIN)/python -m benchmarks.real.five

bench-files: $(VENV)/.run  ## recordings of millions of rows: seconds and memory; a minute or two
	$(BIN)/python -m benchmarks.large_files

bench-install: $(VENV)/.dev  ## the wheel, installed without extras into an environment of its own and tried there
	$(BIN)/python -m benchmarks.install --quick

study-shape: $(VENV)/.run  ## the published shape-matching study in full, resumable; writes docs/studies
	$(BIN)/python -m benchmarks.studies.shape_matching --publish $(STUDY)

# `make study-gripper STUDY="--seed-grasps 3600"` makes the table over seeds at a quarter of the grasps.
study-gripper: $(VENV)/.dev examples/gripper_codesign/gripper_grid.csv  ## the published co-design study: hours, most of them the table over seeds; resumable; writes docs/studies
	$(BIN)/python -m benchmarks.studies.gripper_codesign --publish $(STUDY)

study-reach: $(VENV)/.run  ## a three-chamber arm that reaches around, from FEM to a 3MF file; half an hour; resumable; writes docs/studies
	$(BIN)/python -m benchmarks.studies.reach_around --publish $(STUDY)

examples/gripper_codesign/gripper_grid.csv: | $(VENV)/.run  ## FEM of the designs behind its meta-model, where the table is missing
	$(BIN)/python examples/gripper_codesign/make.py

docs: $(VENV)/.docs  ## the reference pages that are generated from the code, then the site in build/site; needs no network
	$(BIN)/python docs/generate.py
	$(BIN)/python -m sphinx --builder html --conf-dir docs/site --doctree-dir build/doctrees --fail-on-warning --keep-going --quiet . build/site
	@echo "the site: build/site/index.html"

freeze: $(VENV)/.dev
	$(BIN)/python -m pip freeze --exclude-editable

clean:
	rm -rf $(VENV) .pliant runs build docs/python

$(VENV)/.python:
	@test -n "$(PYTHON)" || { echo "Pliant needs Python 3.11 or later; none was found."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.run: $(VENV)/.python pyproject.toml constraints.txt
	$(PIP_INSTALL) --editable '.[all]'
	@touch $@

$(VENV)/.bench: $(VENV)/.run
	$(PIP_INSTALL) --editable '.[all,peers]'
	@touch $@

$(VENV)/.docs: $(VENV)/.run
	$(PIP_INSTALL) --editable '.[all,docs]'
	@touch $@

$(VENV)/.dev: $(VENV)/.run
	$(PIP_INSTALL) --editable '.[all,dev]'
	@touch $@
