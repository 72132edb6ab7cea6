# Copyright 2026 abdf1_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What the package depends on: keys that rosdep knows, and exact versions for tests and tools."""

import ast
from functools import cache
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

import pytest
from support.cases import for_all

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = ElementTree.parse(ROOT / 'package.xml').getroot()
KEYS = dict(line.split() for line in
            (ROOT / 'requirements' / 'rosdep.txt').read_text(encoding='utf-8').splitlines()
            if line and not line.startswith('#'))
LOCKED = ('ros', 'ros_tools_needs', 'test', 'tools', 'fuzz', 'mutation', 'audit', 'kilted')
PINNED = ('ros_tools.txt', *(f'{name}.in' for name in LOCKED))

# The key that brings a module which has another name.
BRINGS = {'serial': 'python3-serial', 'yaml': 'python3-yaml'}


def keys(kind: str) -> set[str]:
    """Return the keys of package.xml of one kind, such as "exec_depend"."""
    return {entry.text or '' for entry in MANIFEST.iter(kind)}


@cache
def imported(folder: str) -> set[str]:
    """Return the modules that the files of a folder import, without those of Python itself."""
    found = set()
    for path in (ROOT / folder).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.split('.')[0])
    return found - sys.stdlib_module_names - {'abdf1_ros', 'pytest'}


def test_rosdep_knows_every_key() -> None:
    assert {entry.text for entry in MANIFEST if entry.tag.endswith('depend')} == KEYS.keys()
    assert set(KEYS.values()) == {'jazzy', 'python.yaml'}
    assert {key for key, source in KEYS.items() if source == 'python.yaml'} == {
        key for key in KEYS if key.startswith('python3-')}


@pytest.mark.parametrize('folder', ['abdf1_ros', 'launch'])
def test_users_get_what_is_imported(folder: str) -> None:
    assert {BRINGS.get(module, module) for module in imported(folder)} <= keys('exec_depend')


def test_only_the_fixture_for_tests_imports_pytest() -> None:
    using = [path.relative_to(ROOT).as_posix() for path in (ROOT / 'abdf1_ros').rglob('*.py')
             if 'import pytest' in path.read_text(encoding='utf-8')]
    assert using == ['abdf1_ros/testing/fixtures.py']


def test_users_get_no_more_than_is_imported() -> None:
    used = {BRINGS.get(module, module)
            for folder in ('abdf1_ros', 'launch') for module in imported(folder)}
    assert keys('exec_depend') == used | {'ros2launch'}  # of every package with launch files


@for_all('name', PINNED)
def test_tools_of_developers_are_pinned(name: str) -> None:
    lines = (ROOT / 'requirements' / name).read_text(encoding='utf-8').splitlines()
    needs = [line for line in lines if line and not line.startswith('#')]
    assert needs
    pin = re.compile(r'[A-Za-z0-9_.-]+(\[[a-z]+\])?==[0-9][0-9.]*[0-9]( +# .*)?'
                     r'|[a-z0-9_]+ @ https://\S+/tags/[0-9.]+\.tar\.gz(#subdirectory=\w+)?')
    assert [line for line in needs if not pin.fullmatch(line)] == []


def test_every_file_of_requirements_is_looked_at() -> None:
    assert {path.name for path in (ROOT / 'requirements').iterdir()} == {
        *PINNED, *(f'{name}.txt' for name in LOCKED), 'rosdep.txt'}


def versions(name: str) -> dict[str, str]:
    """Return the version of each package that a file of requirements pins."""
    text = (ROOT / 'requirements' / name).read_text(encoding='utf-8').lower().replace('_', '-')
    return dict(re.findall(r'^([\w.-]+)(?:\[\w+\])?==([\d.]+)', text, re.MULTILINE))


@for_all('name', LOCKED)
def test_what_is_installed_has_hashes(name: str) -> None:
    text = (ROOT / 'requirements' / f'{name}.txt').read_text(encoding='utf-8')
    lines = [line for line in text.splitlines() if line and not line.startswith('#')]
    assert versions(f'{name}.in').items() <= versions(f'{name}.txt').items()
    for line, following in zip(lines, [*lines[1:], ''], strict=True):
        assert '==' in line or re.fullmatch(r' +--hash=sha256:[0-9a-f]{64}( \\)?', line)
        assert '==' not in line or following.startswith('    --hash=sha256:'), line


@pytest.mark.parametrize('name', ['test.txt', 'tools.txt'])
def test_tests_have_the_versions_of_the_demo(name: str) -> None:
    locked, found = versions('ros.txt'), versions(name)
    assert {key: found[key] for key in found.keys() & locked.keys()} == {
        key: locked[key] for key in found.keys() & locked.keys()}


def test_audit_looks_at_every_file() -> None:
    command = (ROOT / 'Makefile').read_text(encoding='utf-8').partition('\naudit:')[2]
    (names,) = re.findall(r'for name in ([\w ]+);', command.partition('\n\n')[0])
    assert {*names.split()} == {*LOCKED}
