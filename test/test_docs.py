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

"""The documentation names only what exists, links to it, and says nothing twice."""

import ast
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import fields
from functools import cache
from importlib import import_module
import io
import os
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree

from abdf1_ros.cli.main import COMMANDS as MAINS
from abdf1_ros.messages import Message
from abdf1_ros.ros.lines import OPTIONS
from abdf1_ros.ros.parameters.declared import Parameters
from abdf1_ros.settings.columns import MAP_COLUMNS
from abdf1_ros.settings.network import FIELDS, load_network
import pytest
import serial.serialposix
from support import documents
from support.cases import for_all
from support.ros import HAS_FAST_DDS_3, PROFILES_VARIABLE
from support.simulator_process import STATUSES

from tools import reference

NAMESPACE = 'http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles'
ROOT = documents.ROOT
COMMANDS = tuple(MAINS)
OURS = re.compile(rf'(?:ros2 run abdf1_ros |python3? -m abdf1_ros |abdf1 |^(?:\$ )?)'
                  rf'({"|".join(COMMANDS)})\b(.*)')
LAUNCH_ARGUMENTS = set(re.findall(
    r"DeclareLaunchArgument\(\s*'(\w+)'",
    ''.join(path.read_text('utf-8') for path in (documents.ROOT / 'launch').glob('*.py'))))
PARAMETERS = {entry.name for entry in fields(Parameters)} | {
    entry.parameter for entry in FIELDS.values()} | OPTIONS.keys()
TOPICS = {'read', 'write', 'set', 'read_now', *re.findall(r"'~/(\w+)'", (
    ROOT / 'abdf1_ros' / 'ros' / 'bridge' / 'node.py').read_text('utf-8'))}
AT_HOME = {'fuzz'}  # folders that a page puts into the user's home
TARGETS = set(re.findall(r'^([\w-]+):', (ROOT / 'Makefile').read_text('utf-8'), re.MULTILINE))
VARIABLES = set(re.findall(r'^(\w+) \?=', (ROOT / 'Makefile').read_text('utf-8'), re.MULTILINE))


@cache
def help_of(*command: str) -> str:
    """Return what a command says with --help."""
    name, *words = command
    said = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), \
            pytest.raises(SystemExit) as ending:
        patch.setenv('COLUMNS', '200')
        import_module(MAINS[name][0]).main([*words, '--help'])
    assert ending.value.code == 0
    return said.getvalue()


@cache
def subcommands(command: str) -> frozenset[str]:
    return frozenset(re.findall(r'^    (\w+)  ', help_of(command).partition('options:')[0],
                                re.MULTILINE))


def code(name: str) -> Iterator[str]:
    """Yield every line of code on a page, in blocks and in the text."""
    page = documents.text(name)
    for block in documents.blocks(page):
        yield from block.replace('\\\n', ' ').splitlines()
    yield from documents.spans(page)


@for_all('name', [*documents.NAMES, 'test/lab/field.md', '.ci/pythons'])
def test_links_lead_somewhere(name: str) -> None:
    page = documents.text(name)
    for test in re.findall(r'(?<!:)\btest/[\w/]+\.py', page):
        assert (ROOT / test).exists(), test
    for target in re.findall(r'\]\(([^)]+)\)', page):
        if target.startswith(('http://', 'https://')):
            continue
        path, _, anchor = target.partition('#')
        file = (ROOT / name).parent / path if path else ROOT / name
        assert file.exists(), target
        if anchor:
            assert anchor in documents.anchors(file.read_text('utf-8')), target


def test_every_page_is_in_the_index() -> None:
    index = documents.text('docs/README.md')
    pages = {name.removeprefix('docs/') for name in documents.NAMES if name.startswith('docs/')}
    assert [name for name in pages - {'README.md'} if f'({name})' not in index] == []


# To look things up in, or to know how a figure was measured.
LOOKED_UP = ('docs/reference/', 'docs/protocol/', 'docs/heartbeats.md', 'docs/tested_with.md',
             'docs/troubleshooting.md', 'docs/connect.md', 'CONTRIBUTING.md', 'test/RESULTS.md')


def test_pages_that_are_read_through_are_short() -> None:
    sizes = {name: len(documents.prose(documents.text(name)).split())
             for name in documents.NAMES if not name.startswith(LOOKED_UP)}
    assert {name: size for name, size in sizes.items() if size > 1200} == {}


def test_every_command_and_topic_is_in_the_reference() -> None:
    commands, topics = (documents.text(f'docs/reference/{name}.md')
                        for name in ('commands', 'topics'))
    assert 'node' in COMMANDS
    assert 'active_stations' in TOPICS
    assert [command for command in COMMANDS if f'| `{command}' not in commands] == []
    assert [topic for topic in TOPICS if f'| `~/{topic}' not in topics] == []


# Nodes that pages may name: those of config/three_lines.yaml, and of a service called press.
NODES = {'/abdf1', '/press', '/interlock_consumer', '/lines', '/cell/line_1', *re.findall(
    r'^(/[\w/]+):$', (ROOT / 'config' / 'three_lines.yaml').read_text('utf-8'), re.MULTILINE)}


@for_all('name', documents.NAMES)
def test_nodes_that_pages_name_exist(name: str) -> None:
    for line in code(name):
        named = re.findall(r'--node (\S+)', line) + re.findall(r'lines:=\[([\w/, ]+)\]', line)
        for entry in named:
            assert set(entry.split(', ')) <= NODES, line


def test_names_of_rclpy_for_consumers_are_those_of_the_example() -> None:
    example = (ROOT / 'examples' / 'interlock_consumer.py').read_text('utf-8')
    page = documents.text('docs/tutorials/interlocks.md')
    rows = re.search(r'^\| it \| rclpy .*?\n\n', page, re.MULTILINE | re.DOTALL)
    assert rows is not None
    names = [name for row in rows[0].strip().splitlines()[2:]
             for name in re.findall(r'`(\w+)`', row.split('|')[2])]
    assert len(names) > 10
    assert [name for name in names if not re.search(rf'\b{name}\b', example)] == []


@for_all('name', documents.NAMES)
def test_defaults_that_pages_quote_are_right(name: str) -> None:
    defaults = {entry.name: entry.default for entry in fields(Parameters)}
    for parameter, said in re.findall(r'`(\w+)`(?: \w+)? \((true|false|[\d.]+)[,)]', ' '.join(
            documents.text(name).split())):
        if parameter in defaults:
            assert str(defaults[parameter]).lower().removesuffix('.0') == said, parameter


@for_all(('file', 'name'), [part for part in reference.PARTS if part[1] != 'drawing'])
def test_tables_of_the_pages_are_those_of_the_code(file: str, name: str) -> None:
    text = (reference.ROOT / file).read_text(encoding='utf-8')
    assert reference.filled(text, name, reference.PARTS[file, name]()) == text, 'make docs'


def test_every_status_is_in_the_reference() -> None:
    page = documents.text('docs/reference/diagnostics.md')
    names = {re.sub(r'\d+', 'n', status) for status in STATUSES}
    assert [name for name in names if f'| `abdf1: {name}` |' not in page] == []


@for_all('name', documents.NAMES)
def test_rows_of_a_table_have_as_many_cells_as_its_head(name: str) -> None:
    widths: list[int] = []
    for line in documents.without_code(documents.text(name)).splitlines():
        if line.startswith('|'):
            widths.append(len(re.findall(r'(?<!\\)\|', line)))
            assert widths[-1] == widths[0], line
        else:
            widths = []


@for_all('name', documents.NAMES)
def test_commands_and_their_options_exist(name: str) -> None:
    for line in code(name):
        assert not re.search(r'[^$&\s] (?:sudo|ros2) [a-z]', line), f'two commands: {line}'
        match = OURS.search(line)
        if match is None or match[1] in ('node', 'lines'):  # all theirs are ROS arguments
            continue
        command, rest = match[1], match[2].partition('#')[0]
        words = rest.split()
        sub = [words[0]] if words and words[0] in subcommands(command) else []
        for option in re.findall(r'(?<=\s)(--[a-z][\w-]*)', rest):
            assert option in help_of(command, *sub), line


@for_all('name', documents.NAMES)
def test_parameters_that_pages_name_exist(name: str) -> None:
    for line in code(name):
        named = set(re.findall(r'(?:-p |^)([a-z_.]+):=', line))
        assert named <= PARAMETERS | LAUNCH_ARGUMENTS, line


@for_all('name', documents.NAMES)
def test_topics_that_pages_name_exist(name: str) -> None:
    for line in code(name):
        named = set(re.findall(r'(?<![\w/.])(?:~|/abdf1)/([a-z_]+)\b(?!\.)', line))
        assert named <= TOPICS | AT_HOME, line


@for_all('name', documents.NAMES)
def test_make_targets_exist(name: str) -> None:
    for line in code(name):
        for words in re.findall(r'^(?:\S+ )?make ([^#]*)', line):
            for word in re.sub(r"'[^']*'", '', words).split():
                variable, is_set, _ = word.partition('=')
                assert variable in (VARIABLES if is_set else TARGETS), line


@for_all('name', documents.NAMES)
def test_files_that_pages_name_exist(name: str) -> None:
    for span in documents.spans(documents.text(name)):
        if re.fullmatch(r'[\w./@*-]+/[\w.@*-]+\.(py|csv|yaml|json|md|rules|service|txt)', span) \
                and not span.startswith('/'):
            places = (ROOT, ROOT / 'abdf1_ros', (ROOT / name).parent)
            assert any(list(place.glob(span)) for place in places), span


@for_all('name', documents.NAMES)
def test_columns_that_pages_name_exist(name: str) -> None:
    known = {entry.column for entry in FIELDS.values()} | {column.name for column in MAP_COLUMNS}
    for column in re.findall(r'`(\w+)` = ', documents.text(name)):
        assert column in known


@pytest.mark.parametrize(('name', 'lines'), [
    (name, block) for name in documents.NAMES for block in documents.blocks(documents.text(name))
    if block.startswith('Station,')])
def test_net_files_that_are_shown_are_good(name: str, lines: str, tmp_path: Path) -> None:
    file = tmp_path / 'net.csv'
    file.write_text(lines, encoding='utf-8')
    assert load_network(str(file)).station == 5, name


def test_no_sentence_is_said_twice() -> None:
    said: Counter[str] = Counter()
    for name in documents.NAMES:
        for paragraph in re.split(r'\n\s*\n|\n\s*[-|]|\|', documents.prose(documents.text(name))):
            for sentence in re.split(r'(?<=[.:?]) ', ' '.join(paragraph.split())):
                if len(sentence.split()) >= 9:
                    said[sentence] += 1
    assert [sentence for sentence, times in said.items() if times > 1] == []


def test_rules_are_in_short_sentences() -> None:
    page = re.sub(r'\]\(.*?\)', ']', documents.prose(documents.text('docs/heartbeats.md')))
    sentences = [sentence.split() for part in re.split(r'\n\n|\n *(?:\d+\.|\(\w\)|-) ', page)
                 for sentence in re.split(r'(?<=[.:;])\s', part)]
    assert len(sentences) > 100
    assert [sentence for sentence in sentences if len(sentence) > 25] == []


@cache
def printed() -> str:
    """Return all texts of the program, of pyserial's port and of the system, one a line."""
    sources = [*(ROOT / 'abdf1_ros').rglob('*.py'), Path(serial.serialposix.__file__)]
    texts = [entry.template for entry in Message]
    texts += [os.strerror(number) for number in (2, 13, 110)]
    for source in sources:
        texts += [node.value for node in ast.walk(ast.parse(source.read_text('utf-8')))
                  if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return '\n'.join(texts)


def test_troubleshooting_quotes_what_is_printed() -> None:
    quoted = [span for span in documents.spans(documents.text('docs/troubleshooting.md'))
              if re.match(r'[\w ]*[a-z]+ [a-z]+', span) and not OURS.search(span)
              and not re.search(r'--| -\w|\.csv|/dev|make |^ros2 ', span)]
    assert len(quoted) > 10
    for span in quoted:
        for piece in re.split(r'[:;"]|\.\.\.|\b[\dA-F]+\b|\d+ of \d+', span):
            phrase = piece.strip(' :,(){}')
            if len(phrase.split()) > 1:
                assert phrase in printed(), span


@pytest.mark.parametrize(('version', 'element'), [(2, 'heartbeatPeriod'), (3, 'heartbeat_period')])
def test_profiles_of_config_are_those_of_these_tests_but_for_their_transport(
        version: int, element: str) -> None:
    shipped = (ROOT / 'config' / f'fastdds{version}.xml').read_text('utf-8')
    ours = (ROOT / 'test' / 'support' / 'dds.xml').read_text('utf-8')
    assert ElementTree.canonicalize(shipped, strip_text=True) == ElementTree.canonicalize(
        ours.replace('heartbeatPeriod', element), strip_text=True, exclude_tags=[
            f'{{{NAMESPACE}}}{tag}' for tag in (
                'transport_descriptors', 'useBuiltinTransports', 'userTransports')])


def test_profile_of_config_is_taken_by_the_dds_of_this_ros(tmp_path: Path) -> None:
    profile = ROOT / 'config' / f'fastdds{3 if HAS_FAST_DDS_3 else 2}.xml'
    done = subprocess.run(
        [sys.executable, '-c', 'import rclpy; rclpy.init(); rclpy.create_node("profile")'],
        env=os.environ | {PROFILES_VARIABLE: str(profile)}, check=True, capture_output=True,
        text=True)
    assert 'XMLPARSER' not in done.stdout + done.stderr
