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

"""Check parameter files before ROS reads them, because ROS's errors rarely name a line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
from pathlib import Path
import re
from tempfile import TemporaryDirectory

from abdf1_ros.paths import expanded
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.text import printable
import yaml

_PARAMETERS = 'ros__parameters'

# The options of ROS with a file.
_PARAMETER_FILE, _LOG_SETTINGS = '--params-file', '--log-config-file'
_MOST_LEVELS = 20
_TAGS = ('!', *(f'tag:yaml.org,2002:{kind}' for kind in ('bool', 'float', 'int', 'null', 'str')))
# Namespaces, a node name, and wildcards for both.
_NAME = re.compile(r'[\w/*]+', re.ASCII)


def parameter_files(args: Sequence[str]) -> list[str]:
    """Return the parameter files among the arguments of a process."""
    return [path for option, path in zip(args, args[1:], strict=False)
            if option == _PARAMETER_FILE]


def with_home(args: Sequence[str]) -> list[str]:
    """Return the arguments of a process, with the home folder in the paths of ROS's options."""
    return [expanded(text) if option in (_PARAMETER_FILE, _LOG_SETTINGS) else text
            for option, text in zip(['', *args], args, strict=False)]


def parameter_tree(path: str) -> yaml.Node | None:
    """
    Return the YAML nodes of a parameter file.

    Raises ConfigurationError if the file cannot be read, is not a parameter file in YAML, or uses
    YAML features that ROS refuses.
    """
    try:
        text = Path(path).read_text(encoding='utf-8')
        _check_events(path, yaml.parse(text))
        tree = yaml.compose(text)
    except yaml.MarkedYAMLError as error:
        mark, text = error.problem_mark, ' '.join(str(error.problem or error).split())
        if "'\\t'" in text:
            text = 'a tab; YAML is indented with spaces'
        place = Place(path, mark.line + 1, mark.column + 1) if mark else Place(path)
        raise ConfigurationError([Problem(place, text)]) from None
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigurationError([Problem(path, ' '.join(str(error).split()))]) from None
    if isinstance(tree, yaml.ScalarNode):
        raise ConfigurationError([Problem(path, (
            'is not a parameter file, which begins with the name of a node; a CSV is named by '
            f'-p net_file:={path} or -p map_file:={path}'))])
    return tree


def _check_events(path: str, events: Iterable[yaml.Event]) -> None:
    """Raise ConfigurationError for features that ROS refuses, and for too many levels."""
    keys: list[bool | None] = []  # for each open mapping: is a key next? For a list: None
    for event in events:
        if isinstance(event, yaml.CollectionEndEvent):
            keys.pop()
        if not isinstance(event, yaml.NodeEvent):
            continue
        if text := _fault_of(event, len(keys), is_key=bool(keys and keys[-1])):
            place = Place(path, event.start_mark.line + 1, event.start_mark.column + 1)
            raise ConfigurationError([Problem(place, text)])
        if keys and keys[-1] is not None:
            keys[-1] = not keys[-1]
        if isinstance(event, yaml.CollectionStartEvent):
            keys.append(True if isinstance(event, yaml.MappingStartEvent) else None)


def _fault_of(event: yaml.NodeEvent, depth: int, *, is_key: bool) -> str:
    """Return the fault of an event that begins a node; empty if it has none."""
    if isinstance(event, yaml.AliasEvent):
        return f'an alias, *{event.anchor}: ROS does not accept it; write the values out'
    if event.tag and event.tag not in _TAGS:
        return f'the tag {event.tag}: ROS does not know it; leave it out'
    if isinstance(event, yaml.CollectionStartEvent):
        if is_key:
            return 'a list or mapping as a name: a name should be one word'
        if depth >= _MOST_LEVELS:
            return f'more than {_MOST_LEVELS} levels inside each other'
    return ''


@contextmanager
def usable_files(args: Sequence[str], leaves_out: bool) -> Iterator[list[str]]:
    """
    Yield the arguments, with parameter files that ROS accepts as a whole.

    ROS refuses some section names. With ``leaves_out``, copies of the files leave out these
    sections; otherwise ConfigurationError is raised. ConfigurationError is also raised for a file
    that is not YAML.
    """
    usable, problems = list(args), []
    with ExitStack() as copies:  # make a folder only if needed: the disk may be read-only
        for number, path in enumerate(parameter_files(args)):
            if not Path(path).is_file():  # ROS reports why it cannot read the file
                continue
            tree = parameter_tree(path)
            bad = [(name, line) for name, line in _sections(tree)
                   if not _NAME.fullmatch(name)]
            problems += [Problem(Place(path, line), (
                f'"{printable(name)}" cannot name a node: letters, digits and underscores, as in '
                f'{re.sub("[^0-9A-Za-z_/]", "_", name)}')) for name, line in bad]
            if bad and leaves_out:
                try:
                    folder = copies.enter_context(TemporaryDirectory(prefix='abdf1_'))
                except OSError:  # no folder for copies: the user has to correct the names
                    raise ConfigurationError(problems) from None
                copy = Path(folder, f'{number}.yaml')
                _leave_out_bad_names(tree)
                copy.write_text(yaml.serialize(tree), encoding='utf-8')
                usable[usable.index(path)] = str(copy)
        if problems and not leaves_out:
            raise ConfigurationError(problems)
        yield usable


def _leave_out_bad_names(tree: yaml.Node | None) -> None:
    if isinstance(tree, yaml.MappingNode):
        tree.value = [entry for entry in tree.value if _NAME.fullmatch(str(entry[0].value))]
        for key, below in tree.value:
            if key.value != _PARAMETERS:
                _leave_out_bad_names(below)


def _sections(tree: yaml.Node | None) -> Iterator[tuple[str, int]]:
    """Yield the names above ``ros__parameters``, each with its line."""
    for key, below in tree.value if isinstance(tree, yaml.MappingNode) else ():
        if key.value != _PARAMETERS:
            yield str(key.value), key.start_mark.line + 1
            yield from _sections(below)


def node_sections(tree: yaml.Node | None, above: str = '', line: int = 1,
                  ) -> Iterator[tuple[str, int, yaml.Node]]:
    """
    Yield the sections of a parameter file: full node name, line, and parameters.

    A name with wildcards may mean several nodes.
    """
    for key, below in tree.value if isinstance(tree, yaml.MappingNode) else ():
        name, number = str(key.value).strip('/'), key.start_mark.line + 1
        if name != _PARAMETERS:
            yield from node_sections(below, f'{above}/{name}', number)
        else:
            yield above, line, below


def parameters_in(files: Iterable[str]) -> Iterator[tuple[str, str, Place, list[str]]]:
    """Yield each parameter: section, name, place, and the texts of its whole numbers."""
    for path in files:
        for section, _, parameters in node_sections(parameter_tree(path)):
            for name, key, value in _parameters(parameters):
                mark = key.start_mark
                yield (section, name, Place(path, mark.line + 1, mark.column + 1),
                       _whole_numbers(value))


def typed_numbers(text: str) -> list[str]:
    """Return the texts of the whole numbers in a value of the command line."""
    with suppress(yaml.YAMLError):
        return _whole_numbers(yaml.compose(text))
    return []


def _whole_numbers(value: yaml.Node | None) -> list[str]:
    values = value.value if isinstance(value, yaml.SequenceNode) else [value]
    return [each.value for each in values if each is not None and each.tag.endswith(':int')]


def _parameters(tree: yaml.Node, above: str = '') -> Iterator[tuple[str, yaml.Node, yaml.Node]]:
    for key, below in tree.value if isinstance(tree, yaml.MappingNode) else ():
        if isinstance(below, yaml.MappingNode):
            yield from _parameters(below, f'{above}{key.value}.')
        else:
            yield f'{above}{key.value}', key, below


def names_in(tree: yaml.Node) -> Iterator[str]:
    """Yield the names of the parameters of a section."""
    for name, _, _ in _parameters(tree):
        yield name
