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

"""The SROS2 policy: well formed, and neither more nor less than the nodes need."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
import importlib.util
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from abdf1_ros.ros.node import BridgeNode
import pytest
from rclpy.node import Node
import rclpy.utilities
from support.ros import EXAMPLE_FILES, Observer, ros_args

ROOT = Path(__file__).resolve().parent.parent
POLICY = ROOT / 'config' / 'sros2' / 'policy.xml'

# Which elements may stand in which, and the attributes that each has to have or may have.
CHILDREN = {
    'policy': {'contexts'}, 'contexts': {'context'}, 'context': {'profiles'},
    'profiles': {'profile'}, 'profile': {'topics', 'services', 'actions'}, 'topics': {'topic'},
    'services': {'service'}, 'actions': {'action'}, 'topic': set(), 'service': set(),
    'action': set()}
NEEDED = {'policy': {'version'}, 'context': {'path'}, 'profile': {'ns', 'node'}}
QUALIFIERS = {'topics': {'publish', 'subscribe'}, 'services': {'request', 'reply'},
              'actions': {'call', 'execute'}}


def faults(element: ElementTree.Element) -> list[str]:
    """Return what is wrong with the structure of a policy."""
    tag, given = element.tag, element.attrib
    found = [f'{tag} has no {name}' for name in NEEDED.get(tag, set()) - given.keys()]
    qualifiers = QUALIFIERS.get(tag, set())
    found += [f'{tag} has {name}' for name in given.keys() - NEEDED.get(tag, set()) - qualifiers]
    found += [f'{name} of {tag} is {given[name]}' for name in qualifiers & given.keys()
              if given[name] not in ('ALLOW', 'DENY')]
    if not CHILDREN[tag] and not (element.text or '').strip():
        found.append(f'{tag} is empty')
    if CHILDREN[tag] and len(element) == 0:
        found.append(f'{tag} holds nothing')
    for child in element:
        if child.tag in CHILDREN[tag]:
            found += faults(child)
        else:
            found.append(f'{tag} holds {child.tag}')
    return found


def allowed(node: str, kind: str, qualifier: str) -> set[str]:
    """Return the names that the profile of a node allows, ``~`` written out."""
    names: set[str] = set()
    for profile in ElementTree.parse(POLICY).getroot().iter('profile'):
        if profile.attrib['node'] != node:
            continue
        own = f'{profile.attrib["ns"].rstrip("/")}/{node}'
        for group in profile.iter(kind):
            if group.attrib.get(qualifier) == 'ALLOW':
                names |= {(entry.text or '').replace('~', own) for entry in group}
    return names


def uncovered(names: set[str], patterns: set[str]) -> set[str]:
    """Return the names that no pattern matches."""
    return {name for name in names
            if not any(fnmatchcase(name, pattern) for pattern in patterns)}


def unused(names: set[str], patterns: set[str]) -> set[str]:
    """Return the patterns that match no name."""
    return {pattern for pattern in patterns
            if not any(fnmatchcase(name, pattern) for name in names)}


Graph = Callable[[str], set[str]]


@pytest.fixture
def graph() -> Iterator[Graph]:
    """Return what a running bridge publishes, subscribes to and serves, as the graph tells."""
    with Observer() as observer:
        node = BridgeNode(context=observer.context, use_global_arguments=False,
                          cli_args=ros_args(*EXAMPLE_FILES, 'port:=/nowhere/port'))
        yield lambda what: _names(node, what)
        node.destroy_node()


def _names(node: Node, what: str) -> set[str]:
    ask: Any = getattr(node, f'get_{what}_names_and_types_by_node')
    return {name for name, _ in ask(node.get_name(), node.get_namespace())}


def test_policy_is_well_formed() -> None:
    root = ElementTree.parse(POLICY).getroot()
    assert root.tag == 'policy' and faults(root) == []
    contexts = [context.attrib['path'] for context in root.iter('context')]
    assert contexts == ['/abdf1', '/interlock_consumer']


@pytest.mark.parametrize(('text', 'fault'), [
    ('<policy><contexts/></policy>', 'policy has no version'),
    ('<policy version="0.2.0"><contexts/></policy>', 'contexts holds nothing'),
    ('<policy version="0.2.0"><topics/></policy>', 'policy holds topics'),
    ('<topics publish="allow"><topic>a</topic></topics>', 'publish of topics is allow'),
    ('<topics reply="ALLOW"><topic>a</topic></topics>', 'topics has reply'),
    ('<topics publish="ALLOW"><topic> </topic></topics>', 'topic is empty'),
    ('<profile ns="/"><topics><topic>a</topic></topics></profile>', 'profile has no node')])
def test_malformed_policy_is_found(text: str, fault: str) -> None:
    assert fault in faults(ElementTree.fromstring(text))


@pytest.mark.parametrize(('what', 'kind', 'qualifier'), [
    ('publisher', 'topics', 'publish'), ('subscriber', 'topics', 'subscribe'),
    ('service', 'services', 'reply'), ('client', 'services', 'request')])
def test_policy_allows_the_node_exactly_what_it_does(
        graph: Graph, what: str, kind: str, qualifier: str) -> None:
    names, patterns = graph(what), allowed('abdf1', kind, qualifier)
    assert uncovered(names, patterns) == set()
    assert unused(names, patterns) == set()
    assert bool(names) is (what != 'client')


def test_consumer_can_neither_write_nor_call() -> None:
    node = 'interlock_consumer'
    assert allowed(node, 'services', 'request') == set()
    published = allowed(node, 'topics', 'publish')
    assert published == {'/rosout', '/parameter_events'}
    writes = allowed('abdf1', 'topics', 'subscribe')
    assert writes == {'/abdf1/write/*'}
    assert not any(fnmatchcase(write, name) for write in writes for name in published)
    assert uncovered({'/abdf1/write/x'}, allowed(node, 'topics', 'subscribe'))


def test_consumer_can_do_what_the_example_does() -> None:
    spec = importlib.util.spec_from_file_location(
        'interlock_consumer', ROOT / 'examples' / 'interlock_consumer.py')
    assert spec is not None and spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    rclpy.init(args=[])
    try:
        node = example.InterlockConsumer('/abdf1/read/cell_interlocks', 0, 2.0)
        for what, kind, qualifier in (
                ('publisher', 'topics', 'publish'), ('subscriber', 'topics', 'subscribe'),
                ('service', 'services', 'reply'), ('client', 'services', 'request')):
            names = _names(node, what)
            assert uncovered(names, allowed('interlock_consumer', kind, qualifier)) == set()
        node.destroy_node()
    finally:
        rclpy.utilities.try_shutdown()
