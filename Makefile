# make demo   install into .venv and label the bundled example
# make test   install into .venv, lint, check types and run every test, on WORKERS cores
# make soak   kill runs and damage files for SECONDS seconds; not in CI
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= out/office_walk
WORKERS ?= 2
SECONDS ?= 600
SEED ?= 0

.PHONY: demo test lint soak benchmark clean
.DELETE_ON_ERROR:

$(VENV)/installed: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(0 if (3, 11) <= sys.version_info < (3, 14) else "mcpseg needs Python 3.11 to 3.13; set PYTHON=")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing into $(VENV): 0.8 GB to download, 2.9 GB on disk."
	$(BIN)/pip install --disable-pip-version-check -c constraints.txt -e '.[plot]'
	touch $@

$(VENV)/installed-test: $(VENV)/installed
	$(BIN)/pip install --disable-pip-version-check -c constraints.txt -e '.[test]'
	touch $@

demo: $(VENV)/installed
	$(BIN)/mcpseg segment examples/office_walk/scans examples/office_walk/poses.csv -o $(OUT)
	$(BIN)/mcpseg eval $(OUT) examples/office_walk/gt
	@echo; echo "Made in $(OUT):"; cd $(OUT) && ls -l map.ply objects.json events.jsonl run.json state.sqlite && ls scans | wc -l | xargs echo "labelled scans in scans/:"
	$(BIN)/mcpseg export $(OUT) -o $(OUT).png -o $(OUT).html --overwrite --quiet
	@echo; echo "The map as a picture: $(OUT).png"; echo "The map in a browser: $(OUT).html, or '$(BIN)/mcpseg view $(OUT)'"
	@echo "The map as a cloud:   $(OUT)/map.ply, for CloudCompare, MeshLab or Open3D"

lint: $(VENV)/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: lint
	$(BIN)/pytest -n $(WORKERS) --dist worksteal

soak: $(VENV)/installed-test
	mkdir -p out
	$(BIN)/python -m tests.soak --seconds $(SECONDS) --seed $(SEED) -o out/soak.json

benchmark: $(VENV)/installed-test
	$(BIN)/python -m tests.benchmarks.lidar
	$(BIN)/python -m tests.benchmarks.scale --voxels 500000
	$(BIN)/python -m tests.benchmarks.evaluation

clean:
	rm -rf $(VENV) out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
