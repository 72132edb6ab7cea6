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

"""The results of a run: as text, as JSON, and as text for an issue."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
import json

from abdf1_ros.conform.case import CaseResult, Verdict

RunFacts = Mapping[str, str]
"""The facts of a run: target, port, check, station, version."""


def line_of(result: CaseResult) -> str:
    """Return a result as a line; a failure has more lines: expected, got, and the bytes."""
    case = result.case
    text = f'{result.verdict.value:4}  {case.name:24} {case.source:16} {case.rule}'
    if result.verdict is Verdict.SKIP:
        return f'{text}\n        skipped: {result.got}'
    if result.verdict is Verdict.PASS:
        return text
    passed = ''.join(f'\n        {entry}' for entry in result.transcript)
    return f'{text}\n        expected: {result.expected}\n        got:      {result.got}{passed}'


def summary_of(results: Sequence[CaseResult]) -> str:
    """Return the number of cases by verdict."""
    counts = Counter(result.verdict for result in results)
    return ', '.join(f'{counts[verdict]} {word}' for verdict, word in (
        (Verdict.PASS, 'passed'), (Verdict.FAIL, 'failed'), (Verdict.SKIP, 'skipped')))


def _entry(result: CaseResult) -> dict[str, object]:
    return {'case': result.case.name, 'verdict': result.verdict.value, 'rule': result.case.rule,
            'source': result.case.source, 'seconds': round(result.seconds, 3),
            'expected': result.expected, 'got': result.got,
            'transcript': list(result.transcript)}


def as_json(facts: RunFacts, results: Sequence[CaseResult]) -> str:
    """Return the run as JSON: facts, and an entry for each case."""
    return json.dumps({**facts, 'cases': [_entry(result) for result in results]}, indent=1)


def as_issue(facts: RunFacts, results: Sequence[CaseResult]) -> str:
    """Return the run as Markdown, to paste into an issue, and as a row of docs/tested_with.md."""
    head = [f'- {name}: {value}' for name, value in facts.items()]
    rows = [f'| {result.verdict.value} | {result.case.name} | {result.case.source} | '
            f'{_cell(result)} |' for result in results]
    row = (facts['processor'], '', facts['port'], f'{facts["check"]}, {facts["baud"]}',
           f'conform {facts["target"]}: {summary_of(results)}', facts['abdf1_ros'], '')
    return '\n'.join(('### Conformance run', '', *head, f'- result: {summary_of(results)}', '',
                      '| | case | source | |', '| --- | --- | --- | --- |', *rows, '',
                      'The row of docs/tested_with.md; its empty cells are adapter and report:',
                      '', f'| {" | ".join(row)} |'))


def _cell(result: CaseResult) -> str:
    if result.verdict is Verdict.FAIL:
        return f'expected {result.expected}, got {result.got}'
    return result.got if result.verdict is Verdict.SKIP else ''
