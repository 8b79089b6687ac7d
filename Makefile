# SPDX-License-Identifier: Apache-2.0
# The front door. `make build` installs what is missing and builds; all else builds first.

PYTHON := .venv/bin/python
# One more test than there are cores: many wait for a robot's program most of the time.
CTEST := ctest --test-dir build --output-on-failure --no-tests=error \
	    --parallel $(shell expr $$(nproc) + 1)
# At the very end, what failed: ctest prints that where it happens, far above.
FORGET_FAILED := rm -f build/Testing/Temporary/LastTestsFailed.log
SHOW_FAILED := { status=$$?; scripts/show_failed; exit $$status; }

.PHONY: bench build check check-long clean demo docs format lint paper rivals tests wheel \
    wheel-aarch64

# The native module and the messages into the environment; and our Python compiled: where Python is
# told to write no bytecode, it would compile a hundred modules at each start.
PACKAGES = $$($(PYTHON) -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
INSTALL = cmake --install build --component python --prefix "$(PACKAGES)" >/dev/null && \
	    $(PYTHON) -m compileall -q calibration lab tools "$(PACKAGES)/turbopi"

build:
	@scripts/setup build
	@cmake --build build
	@$(INSTALL)

# With the tests, and what they need beside.
tests:
	@scripts/setup check
	@cmake --build build
	@$(INSTALL)

# All tests in C, C++ and Python, and the lint.
check: tests
	@$(FORGET_FAILED); $(CTEST) --label-exclude '^long$$' || $(SHOW_FAILED)

# What takes minutes and seldom fails: the emulated robot with a newer kernel and a whole system.
check-long: tests
	@$(FORGET_FAILED); $(CTEST) --label-regex '^long$$' || $(SHOW_FAILED)

# What was published of these swarms, part by part, checked, with figures. Most of it is MuJoCo's: with
# 20 seeds a cell an hour of two cores. It goes on where it was; MUJOCO_SEEDS=0 leaves it out.
# ACTUATION=table.csv sets measured speeds of robots beside the published ones.
MUJOCO_SEEDS ?= 20
paper: build
	@.venv/bin/twinmill lab claims --mujoco-seeds $(MUJOCO_SEEDS) \
	    $(if $(ACTUATION),--actuation $(ACTUATION)) --out paper

# Installs and builds no more than it shows.
demo:
	@scripts/setup demo
	@cmake --build build --target twin_run twinmill_native lcm_types_generated
	@$(INSTALL)
	@.venv/bin/twinmill demo

# Ourselves against named alternatives, which are installed into .deps, not .venv.
bench: build
	@cmp -s benchmarks/requirements.lock .deps/bench/requirements.lock || { rm -rf .deps/bench && \
	    $(PYTHON) -m pip install --quiet --no-deps --require-hashes --target .deps/bench \
	    --requirement benchmarks/requirements.lock && cp benchmarks/requirements.lock .deps/bench; }
	@cmake --build build --target bench bench_plant bench_sweep >/dev/null
	@status=0; OPENBLAS_NUM_THREADS=1 PYTHONPATH=.deps/bench $(PYTHON) benchmarks/run.py || status=1; \
	    build/bin/bench_sweep || status=1; build/bin/bench_plant || status=1; exit $$status

# Twinmill's diagnosis beside other ways to find what a model lacks, on the same sealed cases; about a
# minute a case. It goes on where it was. RIVALS="--n 20 --json" and the like.
rivals: build
	@cmp -s benchmarks/rivals/requirements.lock .deps/rivals/requirements.lock || { \
	    rm -rf .deps/rivals && $(PYTHON) -m pip install --quiet --no-deps --require-hashes \
	    --target .deps/rivals --requirement benchmarks/rivals/requirements.lock && \
	    cp benchmarks/rivals/requirements.lock .deps/rivals; }
	@OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 PYTHONPATH=benchmarks:.deps/rivals $(PYTHON) -m rivals \
	    $(RIVALS)

format: tests
	@scripts/lint --fix
	@$(PYTHON) docs/site_hooks.py
	@$(PYTHON) tests/app/test_states.py
	@$(PYTHON) tests/python/test_packages.py

lint: tests
	@scripts/lint

# The documentation site in build/site; what it shows is run. Its generator goes into .deps.
docs: build
	@cmp -s docs/requirements.lock .deps/docs/requirements.lock || { rm -rf .deps/docs && \
	    $(PYTHON) -m pip install --quiet --no-deps --require-hashes --target .deps/docs \
	    --requirement docs/requirements.lock && cp docs/requirements.lock .deps/docs; }
	@PYTHONPATH=.deps/docs NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs --quiet build

# One file to install with pip where there is no compiler: dist/twinmill-*.whl, for glibc 2.28 and later ones;
# and dist/twinmill_lab-*.whl, which an article needs beside it.
# What it is compiled with goes into .deps/wheel-root (150 MB fetched). `scripts/wheel dist` alone makes
# one for this machine's glibc and Python.
wheel: build
	@[ -d .deps/wheel-root ] || scripts/make_wheel_root .deps/wheel-root
	@scripts/wheel dist .deps/wheel-root

# The same for 64-bit ARM, as a Raspberry Pi has it, compiled here: what it needs goes into
# .deps/wheel-root-aarch64.
wheel-aarch64: build
	@[ -d .deps/wheel-root-aarch64 ] || scripts/make_wheel_root .deps/wheel-root-aarch64 aarch64
	@scripts/wheel dist .deps/wheel-root-aarch64

# Removes what was built; `rm -rf .venv .deps` also removes what was installed here.
clean:
	@rm -rf build
