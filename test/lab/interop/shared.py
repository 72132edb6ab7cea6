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

"""
Two guests of one product share the port of a node that reads, writes and beats meanwhile.

Both have the same SRC and mostly the same TNS, and words of their own, so a reply that goes to the
other one is a wrong value. Each value is looked at in the PLC and read again by its guest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
import random
from threading import Event
import time
from typing import Any

from cases import Case, same, Values
from ours import BEAT, BEAT_TIME, CLOCK, End, NodeEnd, PlainEnd, PlcEnd, RowAge, Setup

_GUESTS = Case('N7:0', [0.0] * 60, []), Case('N7:100', [0.0] * 60, [])
OWN = Case('N7:200', [1, 2, 3, 4], [4112, -1, 16, 0])
_WORDS = 12  # of a session
PATIENCE = 10.0  # s until words are written: AbDf1 does not say when
_REST = 3.0  # s between two rounds of a session
_LONGEST_BEAT = 1.0  # s between two changes of a heartbeat of 200 ms, on a busy machine


@dataclass(slots=True)
class Tally:
    """
    What came of a run: values of guests that were right at both ends, and wrong ones.

    ``failures`` are commands that the product gave up, that were refused, or that came late
    (AbDf1 tells nobody of a refused write: the word is as it was, and it reads that), ``ours`` the
    values that ROS wrote and read meanwhile, ``wrong_ours`` those that were wrong;
    ``longest_beat`` is in s, ``lost_beats`` counts those that the PLC did not get. ``age`` is that
    of a row of the bridge.
    """

    right: int = 0
    wrong: int = 0
    failures: int = 0
    ours: int = 0
    wrong_ours: int = 0
    beats: int = 0
    longest_beat: float = 0.0
    lost_beats: int = 0
    seconds: float = 0.0
    age: RowAge | None = None

    @property
    def is_good(self) -> bool:
        """Tell whether nobody got a wrong value, all were at work, and no promise was broken."""
        return bool(self.right and self.ours) and not (
            self.wrong or self.wrong_ours or self.lost_beats) \
            and self.longest_beat < _LONGEST_BEAT \
            and (self.age is None or 0 < self.age.seen <= self.age.promised)

    def __str__(self) -> str:
        """Return all of it in lines."""
        lines = [
            f'guests: {self.right} values right, {self.wrong} wrong, {self.failures} rounds that '
            'failed and said so',
            f'ROS: {self.ours} values right, {self.wrong_ours} wrong',
            f'heartbeat: {self.beats} beats in {self.seconds:.0f} s, each {BEAT_TIME} s, '
            f'{self.lost_beats} lost; longest pause {self.longest_beat:.2f} s']
        if self.age is not None:
            lines.append(f'row of the bridge, {self.age.messages} messages: at most '
                         f'{self.age.promised:.2f} s old as promised, {self.age.seen:.2f} s seen')
        return '\n'.join(f'  {line}' for line in lines)


def share(setup: Setup, lines: tuple[str, str], start: Callable[[Setup, str, ExitStack], Any],
          rounds: int, stack: ExitStack) -> Tally:
    """
    Let two guests write and read values on a shared line.

    ``setup`` has no port and no cases, ``lines`` are both ends of the line, ``start`` starts a
    product at a port.
    """
    places = [setup.folder / name for name in ('one', 'two')]
    plc = PlcEnd(replace(setup, port=lines[1], cases=(*_GUESTS, OWN, BEAT)))
    stack.callback(plc.close)
    node = NodeEnd(replace(setup, port=lines[0], cases=(OWN,),
                           share=' '.join(f'pty:{place}' for place in places)))
    stack.callback(node.close)
    guests = []
    for place, case in zip(places, _GUESTS):
        node.until_there(place)
        folder = place.with_suffix('.files')
        folder.mkdir()
        theirs = replace(setup, port=str(place), cases=(case,), folder=folder)
        guests.append((start(theirs, str(place), stack), case))
        stack.callback(guests[-1][0].close)
    return _counted(node, plc, Tally(), [
        partial(work, guest, case, plc, rounds) for guest, case in guests])


def crowd(setup: Setup, lines: tuple[str, str], place: str, reach: Callable[[str], Any],
          sessions: int, seconds: float, stack: ExitStack) -> Tally:
    """
    Let many sessions of a product write and read at one eip: place, each words of its own.

    ``reach`` starts one at the host:port of ``place``. Each rests after each round, as the line,
    which is as slow as one of BAUD, has time for few. The PLC shares no code with the package.
    """
    cases = [Case(f'N7:{_WORDS * number}', [0.0] * _WORDS, []) for number in range(sessions)]
    plc = PlainEnd(replace(setup, port=lines[1], cases=(*cases, OWN, BEAT, CLOCK), is_paced=True))
    stack.callback(plc.close)
    plc.run_clock()
    node = NodeEnd(replace(setup, port=lines[0], cases=(OWN, CLOCK)))
    stack.callback(node.close)
    guests = [(reach(place), case) for case in cases]
    for guest, _ in guests:
        stack.callback(guest.close)
    tally = Tally(seconds=seconds, age=node.watch_age())
    end = time.monotonic() + seconds
    return _counted(node, plc, tally, [
        partial(_until, end, guest, case, plc) for guest, case in guests])


def _counted(node: NodeEnd, plc: End, tally: Tally,
             works: Sequence[Callable[[], Counter[str]]]) -> Tally:
    """Do each work in a thread while our node writes and beats; return the tally of all."""
    ended = Event()
    with ThreadPoolExecutor(len(works) + 1) as pool:
        done = [pool.submit(each) for each in works]
        watch = pool.submit(_watch, plc, tally, ended)
        _write_own(node, plc, tally, lambda: all(future.done() for future in done))
        ended.set()
    watch.result()
    counts = sum((future.result() for future in done), Counter())
    return replace(tally, **counts)


def _until(end: float, guest: Any, case: Case, plc: End) -> Counter[str]:
    """Do rounds until ``end``."""
    counts: Counter[str] = Counter()
    chance = random.Random(case.address)
    while time.monotonic() < end:
        counts += work(guest, case, plc, 1, chance)
        time.sleep(_REST)
    return counts


def _write_own(node: NodeEnd, plc: End, tally: Tally, is_over: Callable[[], bool]) -> None:
    """Let ROS write and read values of its own meanwhile."""
    while not is_over():
        for values in (OWN.before, OWN.after):
            node.give(OWN, values)
            good = same(values, plc.take(OWN, values)) and same(values, node.take(OWN, values))
            tally.ours += good * OWN.count
            tally.wrong_ours += not good


def work(guest: Any, case: Case, plc: End, rounds: int,
         chance: random.Random | None = None) -> Counter[str]:
    """
    Write values of chance, look at them in the PLC, and read them again.

    A write that comes late, maybe in a later round, is a failure: its words are old or its own.
    """
    chance = chance or random.Random(case.address)
    counts: Counter[str] = Counter()
    known = [plc.take(case, [])]  # what may stand in the PLC
    for _ in range(rounds):
        values: Values = [chance.choice((4112, chance.randrange(-32768, 32768)))
                          for _ in range(case.count)]
        known.append(values)
        is_given = 'done' in guest.write(case, values)
        end = time.monotonic() + PATIENCE * is_given
        while not same(values, there := plc.take(case, values)) and time.monotonic() < end:
            time.sleep(0.01)
        answer = guest.read(case)
        later = plc.take(case, values)  # a late write may come before, during or after the read
        if is_given and same(values, there) and same(values, answer.get('values')):
            counts['right'] += case.count
            known = [values]
        elif _are_among(known, there, later, answer.get('values', later)):
            counts['failures'] += 1
        else:
            counts['wrong'] += case.count
    return counts


def _are_among(known: Sequence[Values], *seen: Values) -> bool:
    """Tell whether each word that was seen is one of those that are known for its place."""
    return all(any(same([entry], [word]) for entry in entries)
               for words in seen for word, *entries in zip(words, *known, strict=True))


def _watch(plc: End, tally: Tally, ended: Event) -> None:
    """Measure the time between two beats."""
    last, since = plc.take(BEAT, []), time.monotonic()
    while not ended.wait(0.01):
        now = time.monotonic()
        if (value := plc.take(BEAT, [])) != last:
            tally.lost_beats += bool(tally.beats) and value != [last[0] % 32767 + 1]
            tally.longest_beat = max(tally.longest_beat, (now - since) * bool(tally.beats))
            tally.beats += 1
            last, since = value, now
