# A fresh machine needs python3, make and git; `make fly` and `make test` do the rest.
PYTHON ?= python3
ARGS ?=
JOBS ?= 2
BIN = .venv/bin
SCRIPTS = tools/bootstrap.py tools/client_environments.py tools/extract_log.py tools/readme_hook.py
CLIENTS = tests/clients/requirements

.PHONY: fly test slow trial soak lint bench schemas docs site requirements clean
.DEFAULT_GOAL := fly

fly: .venv/.made  ## the escort of a recorded real flight; more with ARGS="--method tangential …"
	@$(BIN)/outrider swarm escort $(ARGS)

test: .venv/.made  ## all tests but the slow ones; one test with ARGS="-k name"
	@$(BIN)/pytest -m "not slow" -n $(JOBS) --dist loadfile --max-worker-restart 0 $(ARGS) </dev/null

slow: .venv/.made .venv/clients/.made  ## the slow tests: flights, browsers, other people's clients, wheels
	@$(BIN)/pytest -m slow -n $(JOBS) --dist loadfile --max-worker-restart 0 $(ARGS) </dev/null

trial: .venv/.made  ## five companions on five vehicles through all that may happen; ARGS="--story sortie --flavour px4", docs/real-firmware.md
	@$(BIN)/python -m trials $(ARGS)

soak: .venv/.made  ## what is too long for CI, about an hour; part of it with ARGS="-k yaml"
	@$(BIN)/pytest --soak -vv -n $(JOBS) --dist worksteal $(ARGS) </dev/null

lint: .venv/.made  ## style, types, and who may import whom
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/mypy $(SCRIPTS)
	@$(BIN)/lint-imports

bench: .venv/.made  ## measure this machine
	@$(BIN)/outrider bench $(ARGS)

schemas: .venv/.made  ## write config/schemas anew after a change of a configuration model
	@$(BIN)/python -m outrider.schemas config/schemas

docs: .venv/.made  ## write the reference pages in docs anew: Python interface, settings
	@$(BIN)/python -m reference

site:  ## the pages of docs as a site in build/site, with mkdocs-material in an environment of its own
	@test -x build/mkdocs/bin/mkdocs || ($(PYTHON) -m venv build/mkdocs && build/mkdocs/bin/pip install -q "mkdocs<2" "mkdocs-material>=9.5,<10")
	@NO_MKDOCS_2_WARNING=1 build/mkdocs/bin/mkdocs build -q

requirements:  ## write uv.lock and requirements.txt anew after a change of dependencies; needs uv
	@uv lock
	@uv export --locked --extra sitl --extra export --extra view --extra cluster --extra gym --extra pandas --group dev --no-emit-project --no-header --no-annotate --quiet \
		--format requirements-txt --output-file requirements.txt
	@for client in $(basename $(wildcard $(CLIENTS)/*.in)); do \
		uv pip compile --universal --no-deps --generate-hashes --python-version 3.11 --no-header --no-annotate --quiet \
		$$client.in --output-file $$client.txt >/dev/null || exit; done

clean:  ## everything that was made, the environment too
	@rm -rf .venv build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/.made: pyproject.toml uv.lock requirements.txt tools/bootstrap.py
	@$(PYTHON) tools/bootstrap.py

.venv/clients/.made: .venv/.made tools/client_environments.py $(wildcard $(CLIENTS)/*.txt)
	@$(BIN)/python tools/client_environments.py
