# make demo   the whole main job on a sample part          make serve  the app in a browser
# make test   lint, types, contracts, tests                make bench  the ratios of docs/benchmarks.md
PYTHON ?= python3.11
BIN := .venv/bin

.PHONY: demo test serve bench lint format golden samples picture constraints clean

.venv/runtime.stamp: pyproject.toml constraints.txt
	@$(PYTHON) -m venv .venv 2>/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends python3.11-venv && rm -rf .venv && $(PYTHON) -m venv .venv; \
	  else echo "Python 3.11 with its venv module is needed (Debian: apt-get install python3.11-venv)." >&2; exit 1; fi; }
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e .
	@touch $@

.venv/test.stamp: .venv/runtime.stamp
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[test]'
	@command -v chromium >/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; \
	  else echo "The browser tests need Chromium (Debian: apt-get install chromium)." >&2; exit 1; fi; }
	@touch $@

demo: .venv/runtime.stamp
	@$(BIN)/echobase demo -o demo

serve: .venv/runtime.stamp
	@$(BIN)/echobase serve

# The browser tests get a process of their own: software rendering wants the machine to itself.
test: .venv/test.stamp lint
	$(BIN)/python -m pytest tests/browser
	$(BIN)/python -m pytest --ignore=tests/browser

lint: .venv/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: .venv/test.stamp
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: .venv/test.stamp
	$(BIN)/python -m benchmarks

golden: .venv/test.stamp
	$(BIN)/python -m tests.krl.update_golden

picture: .venv/test.stamp
	$(BIN)/python -m tests.browser.picture

constraints: .venv/test.stamp
	$(BIN)/python -m pip freeze --exclude-editable --exclude echobase > constraints.txt

clean:
	rm -rf .venv demo data .mypy_cache .ruff_cache .hypothesis
