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

"""The words of CONTRIBUTING.md: one term for one thing, plain sentences, no class twice."""

import ast
from collections import Counter
from collections.abc import Iterator
import io
from pathlib import Path
import re
import tokenize

import pytest

from tools.rooms import MODULES, PACKAGE

ROOT = PACKAGE.parent

_NAMES = re.compile(
    r'^ *class (?P<class>\w+)|^(?P<alias>_?[A-Z][a-z]\w*) = (?![\w.]+\()',  # not of TypeVar
    re.MULTILINE)

# "There is no" is easy to read for people of another language, "this is no" is not.
_IS_NO = r'(?<!there )(?<!There )\bis no\b(?! longer| more)'


def forbidden_words() -> list[str]:
    """Return the words in the column "not" of the table in CONTRIBUTING.md."""
    text = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    section = text.partition('\n## Words\n')[2].partition('\n## ')[0]
    rows = [line.strip('|').split('|') for line in section.splitlines() if line.startswith('|')]
    return [word.strip() for row in rows[2:] for word in row[2].split(',') if word.strip()]


def names_of(source: str) -> Iterator[str]:
    """Yield the classes and type aliases of a module, without a leading underscore."""
    for match in _NAMES.finditer(source):
        yield (match['class'] or match['alias']).lstrip('_')


def pages() -> list[Path]:
    """Return all texts of ours that people read, but for CONTRIBUTING.md itself."""
    return [*(PACKAGE / module for module in MODULES), *sorted((ROOT / 'docs').rglob('*.md')),
            *sorted((ROOT / 'tools').glob('*.py')), *sorted((ROOT / 'examples').glob('*.py')),
            ROOT / 'README.md']


def test_no_two_classes_of_a_room_have_one_name() -> None:
    counts = Counter((module.partition('/')[0], name) for module in MODULES
                     for name in names_of((PACKAGE / module).read_text(encoding='utf-8')))
    assert [name for name, count in counts.items() if count > 1] == []
    assert counts['driver', 'Driver'] == counts['pccc', 'Request'] == 1


def test_no_two_classes_of_the_package_have_one_name() -> None:
    """``conform`` shares nothing with the link that it judges, names included."""
    counts = Counter(match['class'].lstrip('_') for module in MODULES
                     if not module.startswith('conform/') for match in _NAMES.finditer(
                         (PACKAGE / module).read_text(encoding='utf-8')) if match['class'])
    assert [name for name, count in counts.items() if count > 1] == []
    assert counts['Driver'] == 1


# Of machines: reported, random, without effect, cleanly, a noun for the pronoun, and what does it.
_IDIOMS = re.compile(
    r'\b(?:nobody|somebody|by chance|in vain|reckon with|(?:for|to) people'
    r'|(?:is|are|was|were|be|been|has|have|had|not|and) told|ends? (?:all |both )?in order(?! to)'
    r'|that one(?=[.,;:)]|$)'
    r'|(?<!after )the other(?= (?:goes|sends|waits)\b))(?!\w)', re.IGNORECASE | re.MULTILINE)


def texts(path: Path, source: str) -> Iterator[tuple[int, str]]:
    """Yield what people read of a file, with its line number: of code comments and strings."""
    if path.suffix != '.py':
        yield from enumerate(source.splitlines(), 1)
        return
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.COMMENT, tokenize.STRING):
            for number, line in enumerate(token.string.splitlines(), token.start[0]):
                yield number, re.sub('``.*?``|`.*?`', '', line)


def test_plain_words() -> None:
    sources = ((path, path.read_text(encoding='utf-8')) for path in pages())
    found = [f'{path.relative_to(ROOT)}:{number}: {line.strip()}' for path, source in sources
             if _IDIOMS.search(source)  # most need not be taken apart
             for number, line in texts(path, source) if _IDIOMS.search(line)]
    assert found == []


def test_one_term_for_one_thing() -> None:
    words = forbidden_words()
    assert {'errand', 'hasten', 'namesake'} <= set(words)
    # Not inside of words: troubleshooting stays. But as a part of a name, in any case.
    pattern = re.compile(rf'(?<![a-z])(?:{"|".join(words)})(?:s|ed|ing)?(?![a-z])|{_IS_NO}',
                         re.IGNORECASE)
    found = [f'{page.relative_to(ROOT)}:{number}: {line.strip()}' for page in pages()
             for number, line in enumerate(page.read_text(encoding='utf-8').splitlines(), 1)
             if pattern.search(line)]
    assert found == []


# Phrases that make a reader stop: the subject is unnamed, or the sentence a chain of pronouns.
_PRONOUN = r'\b(?:it|that|them|which|whose)\b'
RIDDLES = {
    'a number without its noun': r'\b[Ss]o (?:many|often|long|much|few)\b(?! (?:as|that)\b)',
    'a noun left out': r'\b(?:that|those) (?:of|for|in|on|at|by|from|to)\b',
    'a subject described, not named': r'(?:^|[.:;] )What (?:\w+ ){1,6}\w+[,.]',
    'a party without a name': (
        r"\b(?:[Oo]thers?'s?|another's|[Ww]hoever|[Ss]omebody|[Nn]obody|one another)"
        r'\b(?! \w+s\b)'),
    'a decision without its reason': (
        r'\b(?:is|are|was|were|be) taken for\b|\bone (?:knows|does|has|sees)\b'),
    'not what the method does': r'\b[Tt]ake note\b',
    'a condition said by its contrast': (
        r'\b(?:none|nothing|no one|not|but) (?:but|else) (?:that|those|what|where)\b|\bbut for\b'),
    'a chain of pronouns': '[^.;:]*'.join([_PRONOUN] * 4)}

# Some sentences are found though they are plain. The limits leave room for them only.
MOST_RIDDLES = {'abdf1_ros': 10, 'docs': 10}
_HEAD = 13  # lines of the licence
_COMMENT = re.compile(r'^( *|.*\S  )# (.*)')  # before it: what is code


def docstrings_and_comments(source: str) -> Iterator[tuple[int, str]]:
    """Yield each docstring, also of attributes, and each block of comments, on one line."""
    for node in ast.walk(ast.parse(source)):
        if (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
                and isinstance(node.value.value, str)):
            yield node.lineno, ' '.join(node.value.value.split())
    block: list[str] = []
    start = 0
    # A string that looks like a comment is read too; to take all apart costs ten times as much.
    for number, line in enumerate([*source.splitlines()[_HEAD:], 'end'], _HEAD + 1):
        match = _COMMENT.match(line)
        is_whole = match is not None and not match[1].strip()
        if block and line and not is_whole:
            yield start, ' '.join(block)
            block = []
        if match is not None and is_whole:
            start = start if block else number
            block.append(match[2])
        elif match is not None:
            yield number, match[2]


def riddles(folder: str) -> list[str]:
    """Return the sentences of a folder that have to be read twice, each with its place."""
    found = []
    for path in sorted([*(ROOT / folder).rglob('*.py'), *(ROOT / folder).rglob('*.md')]):
        source = path.read_text(encoding='utf-8')
        parts = docstrings_and_comments(source) if path.suffix == '.py' \
            else enumerate(source.splitlines(), 1)
        found += [f'{path.relative_to(ROOT)}:{line}: {why}: {sentence}'
                  for line, text in parts for sentence in re.split(r'(?<=[.!?])\s+', text)
                  for why, pattern in RIDDLES.items() if re.search(pattern, sentence)]
    return found


@pytest.mark.parametrize('folder', MOST_RIDDLES)
def test_few_sentences_have_to_be_read_twice(folder: str) -> None:
    found = riddles(folder)
    assert len(found) <= MOST_RIDDLES[folder], '\n'.join(found)
