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

"""The picture of ``check --html``: one poll cycle, and the line's time that the Periods need."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from abdf1_ros.cli.lanes import Bar, cells, drawing, key, Lane, Look, text_of
from abdf1_ros.plan.planner import Block
from abdf1_ros.plan.report import last_address, Report
from abdf1_ros.problems import Problem
from abdf1_ros.text import counted, first, milliseconds

_KEY = ((Look.ASK, 'on the line'), (Look.BAD, 'its Period cannot be kept'),
        (Look.WAIT, 'the PLC has not answered yet'), (Look.SMALL, 'heartbeats, the mode of PLCs'))
_HEAD = ('station', 'from', 'to', 'words', 'packets', 'line ms', 'total ms', 'Period ms',
         'expected ms', 'line', 'tags')
_TAGS = 8


def check_parts(report: Report | None, problems: Sequence[Problem],
                facts: Sequence[str]) -> Iterator[str]:
    """Yield the parts of the page; ``facts`` are sentences about the line and its times."""
    if report is None:
        yield _sentence('no plan without a good net file', 'verdict is-bad')
    else:
        yield from _plan(_Picture(report), len(problems), facts)
    yield from (_sentence(f'error: {problem}', 'is-bad') for problem in problems)
    if report is not None:
        yield from (_sentence(f'warning: {remark.text}', 'is-odd') for remark in report.remarks())
        yield from (_sentence(f'note: {note}', 'quiet') for note in report.notes())


def _plan(picture: _Picture, errors: int, facts: Sequence[str]) -> Iterator[str]:
    is_good = not errors and not picture.late
    found = [counted(errors, 'error') + '; the picture has only the rows without errors'] \
        if errors else []
    yield _sentence('; '.join([*found, picture.verdict()]),
                    f'verdict {"is-good" if is_good else "is-bad"}')
    if picture.report.blocks and not picture.report.network.line_mode.only_listens:
        yield from picture.drawings()
        yield '<h2>Reads</h2>'
        yield picture.table()
    yield '<h2>In words</h2>'
    yield from map(_sentence, facts)


def _sentence(text: str, look: str = '') -> str:
    return f'<p class="{look}">{text_of(text)}</p>' if look else f'<p>{text_of(text)}</p>'


class _Picture:
    """The drawing of a report; ``late`` are the blocks whose Period cannot be kept."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self._expected = report.intervals() if report.is_timed else {}
        self.late = [block for block in report.blocks if self._is_late(block)]

    def _is_late(self, block: Block) -> bool:
        return 0 < block.period < 0.999 * self._expected.get(block, 0.0)

    def verdict(self) -> str:
        report = self.report
        if report.network.line_mode.only_listens:
            return 'the bridge only listens: it sends nothing'
        if not report.is_timed:
            return f'the Periods need {report.load:.0%} of the line at least'
        kept = f'{len(self.late)} of {counted(len(report.blocks), "read")} cannot keep the ' \
            'Period' if self.late else 'every Period can be kept'
        return f'{kept}; load of the line: {report.load:.0%}'

    def drawings(self) -> Iterator[str]:
        if self.report.is_timed:
            yield '<h2>One poll cycle: everything is read once</h2>'
            yield key(_KEY)
            yield drawing(self._cycle(), 0.0, self.report.poll_cycle * 1000, 'ms')
        yield '<h2>What the Periods need of the time there is</h2>'
        lane = Lane('the line', [*self._shares()])
        yield drawing([lane], 0.0, max(100.0, self.report.load * 100), '%', limit=100.0)
        if any(not block.period for block in self.report.blocks):
            yield _sentence('Reads with Period 0 have the time that is left.', 'quiet')

    def _cycle(self) -> list[Lane]:
        """Return a lane for each station, with its reads in sequence."""
        bars: defaultdict[int, list[Bar]] = defaultdict(list)
        begin = 0.0
        for block in self.report.blocks:
            answer, end = begin + block.line_time * 1000, begin + self.report.time(block) * 1000
            title = self._title(block)
            look = Look.BAD if self._is_late(block) else Look.ASK
            bars[block.station] += [Bar(begin, answer, look, title, _labels(block)),
                                    Bar(answer, end, Look.WAIT, title)]
            begin = end
        return [Lane(f'station {station}', found) for station, found in sorted(bars.items())]

    def _shares(self) -> Iterator[Bar]:
        """Yield the share of the line's time (%) for each read, the largest first."""
        begin = 0.0
        polled = [block for block in self.report.blocks if block.period]
        for block in sorted(polled, key=self._load, reverse=True):
            end = begin + self._load(block) * 100
            look = Look.BAD if self._is_late(block) else Look.ASK
            labels = [f'{block.station}: {label}' for label in _labels(block)]
            yield Bar(begin, end, look, self._title(block), labels)
            begin = end
        rest = self.report.load * 100 - begin
        if rest > 0.01:
            yield Bar(begin, begin + rest, Look.SMALL, f'heartbeats and questions for the mode: '
                      f'{rest:.1f} % of the time')

    def _load(self, block: Block) -> float:
        return self.report.time(block) / block.period if block.period else 0.0

    def _title(self, block: Block) -> str:
        wanted = f'Period {milliseconds(block.period)}' if block.period else 'Period 0'
        expected = self._expected.get(block)
        late = f', expected {milliseconds(expected)}' if self._is_late(block) else ''
        return (f'station {block.station}, {_labels(block)[0]}: {counted(block.words, "word")} in '
                f'{milliseconds(self.report.time(block), 1)}; {wanted}{late}; '
                f'{self._load(block):.1%} of the time; {_tags(block)}')

    def table(self) -> str:
        rows = []
        for block in self.report.blocks:
            expected = self._expected.get(block)
            told = '' if expected is None else f'{expected * 1000:.0f}'
            if self._is_late(block):
                told = f'<b class="is-bad">{told}</b>'
            cell = (block.station, block.start, _last(block), block.words, len(block.requests),
                    f'{block.line_time * 1000:.1f}', f'{self.report.time(block) * 1000:.1f}',
                    f'{block.period * 1000:.0f}')
            rows.append([*(text_of(str(part)) for part in cell), told,
                         f'{self._load(block):.1%}', text_of(_tags(block))])
        return cells(_HEAD, rows, right=(0, 3, 4, 5, 6, 7, 8, 9))


def _last(block: Block) -> str:
    return str(last_address(block.start, block.span.end - 1))


def _labels(block: Block) -> Sequence[str]:
    start, last = str(block.start), _last(block)
    return (start,) if start == last else (f'{start} to {last}', start)


def _tags(block: Block) -> str:
    return first([mapping.tag for mapping in block.mappings], _TAGS)
