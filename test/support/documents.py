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

"""The pages of the documentation, taken apart."""

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parent.parent.parent
PAGES = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md'),
                ROOT / 'test' / 'RESULTS.md', ROOT / 'test' / 'lab' / 'interop' / 'README.md',
                *(ROOT / 'vectors').rglob('*.md')])
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]

_BLOCK = re.compile(r'(<!-- runs -->\n\n)?^```(\w*)\n(.*?)^```$', re.DOTALL | re.MULTILINE)


def text(name: str) -> str:
    """Return a page."""
    return (ROOT / name).read_text(encoding='utf-8')


def blocks(page: str, only_run: bool = False) -> list[str]:
    """Return the code blocks of a page; with ``only_run``, those that are marked."""
    return [body for mark, _, body in _BLOCK.findall(page) if mark or not only_run]


def without_code(page: str) -> str:
    """Return a page without its code blocks."""
    return _BLOCK.sub('', page)


def prose(page: str) -> str:
    """Return a page without its code blocks and without what is made from the code."""
    return without_code(re.sub(
        r'<!-- generated: .*?<!-- end: [\w-]+ -->', '', page, flags=re.DOTALL))


def spans(page: str) -> list[str]:
    """Return the pieces of code inside the text of a page."""
    return [' '.join(span.split()) for span in re.findall(r'`([^`]+)`', without_code(page))]


def anchors(page: str) -> set[str]:
    """Return what links into a page may name."""
    found = set(re.findall(r'<a id="(.*?)">', page))
    for heading in re.findall(r'^#+ (.*)$', without_code(page), re.MULTILINE):
        found.add(re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-'))
    return found
