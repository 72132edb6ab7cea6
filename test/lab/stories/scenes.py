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

"""The scenes of all stories: tiny plants, and what may deviate from their conversation."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field, replace
from enum import Enum

from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Command, Mapping
from support.world import Plant, SAFE

DIRECT = ('no reply', 'lost', 'refused')
KEPT = ('kept last', 'kept 1', 'kept 2', 'sts last', 'sts 1', 'sts 2')
Change = Callable[[list[Mapping]], list[Mapping]]

_AFTER = 700  # ms
_TWO_PACKETS = 42  # words for an SLC 5/01

GATEWAY = (*DIRECT, 'not delivered', 'told undelivered', *KEPT)
BEFORE = tuple(f'before {word} {when}'
               for word in ('speed', 'beat') for when in ('1', '2', 'last'))


def _without(*tags: str) -> Change:
    return lambda rows: [row for row in rows if row.tag not in tags]


def _changed(tag: str, **changes: object) -> Change:
    return lambda rows: [replace(row, **changes) if row.tag == tag else row  # type: ignore
                         for row in rows]


def _bits(rows: list[Mapping]) -> list[Mapping]:
    """Return rows with outputs of one bit each, of a word that is written back as a whole."""
    old = [replace(row, processor=Processor.ML1000) for row in rows]
    for tag, place, values in (('w0_1', 'N7:0/4', (0,)), ('free_1', 'N7:0/3', None)):
        old = _changed(tag, address=parse_address(place, PlcType.SLC), type=ValueType.BOOL,
                       fallback=values and Fallback(values, _AFTER))(old)
    return old


def _long(rows: list[Mapping]) -> list[Mapping]:
    """Return rows with an output that is written in two packets."""
    return _changed('w0_1', address=parse_address('N7:30', PlcType.SLC), length=_TWO_PACKETS,
                    fallback=Fallback(_TWO_PACKETS * (SAFE,), _AFTER))(
        [replace(row, processor=Processor.SLC_5_01) for row in rows])


RELOADS: dict[str, Change] = {
    'same': list,
    'speed gone': lambda rows: _without('w0_1')(_changed('beat_1', condition=None)(rows)),
    'speed bare': _changed('w0_1', fallback=None),
    'speed moved': _changed('w0_1', address=parse_address('N7:21', PlcType.PLC5)),
    'beat gone': _without('beat_1')}

EVENTS = ('message', 'message 0.5', 'guest speed', 'guest beat', 'guest unknown', 'silent 0.7',
          'silent 3.0', 'program 0.5', 'program 3.0', 'download 3.0', 'still 0.4', 'still 1.6',
          'executor 1.6', 'unplug 0.5', 'kill 0.3', 'end 0.3', 'polling 0.4',
          *(f'reload {name}' for name in RELOADS))


@dataclass(frozen=True, slots=True)
class Scene:
    """
    A plant, the ``messages`` of its first output (s after the start), and what may deviate.

    At each of the ``slots`` (s) one of the ``events`` may happen. Each write to a word of
    ``fates_of`` may have one of the ``fates``, and may meet one of the events of ``meets``:
    ``f`` is the output, ``h`` the heartbeat, ``w`` the row without Fallback, ``g`` what a guest
    writes. ``rows`` returns what becomes of the rows of the plant, ``called`` are those that the
    messages are for.
    """

    name: str
    plant: Plant
    messages: tuple[float, ...] = (0.8,)
    slots: tuple[float, ...] = ()
    events: tuple[str, ...] = ()
    fates: tuple[str, ...] = ()
    fates_of: str = 'fg'
    until: float = 4.0  # s: later writes have no fates
    meets: tuple[str, ...] = ()
    first: str = 'same'  # of RELOADS: the rows before the first reload
    rows: Change = list
    given: MappingType[str, str] = field(default_factory=dict)  # what happens in each story
    equals: tuple[float, ...] = ()  # s, when the last message of the output comes once more
    called: tuple[str, ...] = ('w0_1',)
    is_refreshed: bool = False  # Fallbacks that stand are written again, each second
    is_read_back: bool = True  # heartbeats


def _plant(mode: str = 'Peer', **others: object) -> Plant:
    usual = Plant(mode, rows=1, baud=38400, after=_AFTER, period=500, requires=600)
    return replace(usual, **others)  # type: ignore[arg-type]


def _slots(first: float = 0.05, last: float = 3.4, step: float = 0.3) -> tuple[float, ...]:
    return tuple(round(first + step * at, 2) for at in range(int((last - first) / step) + 1))


_CALLED = (0.8, 1.2, 1.6)
_BOTH = ('w0_1', 'w0_2')
_FREE = _plant(requires=None)  # its heartbeat counts without messages
# An output that is read, and whose equal messages may be left out.
_AGAIN = _changed('w0_1', command=Command.READ_WRITE, write_again=1500, period=150)

_LARGE = (
    Scene('direct', _plant(), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('sts', _plant(), _CALLED, _slots(), (*EVENTS, *BEFORE), GATEWAY, 'fgh'),
    Scene('via', _plant('Gateway'), _CALLED, _slots(), (*EVENTS, *BEFORE), GATEWAY, 'fgh'),
    Scene('meets', _plant('Gateway'), _CALLED, fates=GATEWAY, fates_of='fgh', meets=EVENTS),
    Scene('master', _plant('Message'), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('standard', _plant('Standard'), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('radio', _plant('Radio'), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('stored', _plant(may_store=True), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('two', _plant('Message', stations=2), _CALLED, _slots(), EVENTS, DIRECT, 'fgh',
          called=_BOTH),
    Scene('read', _plant('Gateway', held=21), _CALLED, _slots(), EVENTS, GATEWAY, 'fgh'))
# Few ways each: all pairs of them in seconds.
_SMALL = (
    Scene('little sts', _plant(), slots=(1.2, 1.75), fates_of='fg',
          events=('reload same', 'guest speed', 'message', 'polling 0.4'),
          fates=('kept last', 'kept 1', 'sts last', 'sts 1'),
          meets=('reload same', 'polling 0.4', 'unplug 0.5')),
    Scene('little via', _plant('Gateway'), slots=(0.05, 1.3), fates_of='fg',
          events=('before speed 1', 'before speed last', 'polling 0.4', 'guest speed',
                  'silent 0.7'),
          fates=('kept last', 'not delivered', 'sts 1'),
          meets=('reload same', 'kill 0.3', 'polling 0.4')),
    Scene('little before', _plant(), slots=(0.05, 0.5, 1.3, 1.9), fates_of='fh',
          events=('before speed 1', 'before speed last', 'before beat last', 'polling 0.4',
                  'message'), fates=('not delivered', 'no reply')),
    Scene('little beat', _plant('Gateway'), slots=(1.35, 1.55, 1.8, 2.1), fates_of='h',
          events=('message', 'guest beat', 'polling 0.4'),
          fates=('kept last', 'kept 1', 'sts 1', 'sts last')),
    Scene('little run', _plant(), slots=(0.9, 1.2, 1.75, 2.45), fates_of='f',
          events=('program 3.0', 'download 3.0', 'silent 0.7', 'message', 'polling 0.4',
                  'foreign'), fates=DIRECT),
    Scene('little end', _plant(), slots=(0.95, 1.25, 1.7), fates_of='f',
          events=('unplug 0.5', 'end 0.3', 'guest speed', 'message', 'overwrite', 'still 1.6'),
          fates=('kept last', 'kept 2', 'lost')),
    Scene('little free', _FREE, messages=(), slots=(0.05, 0.5, 0.9, 1.3, 1.9), fates_of='fh',
          events=('before speed last', 'before beat 1', 'polling 0.4', 'guest speed'),
          fates=('not delivered', 'no reply', 'refused')),
    Scene('little reloads', _plant(), slots=(0.9, 1.2, 1.6), fates_of='fh',
          events=tuple(f'reload {name}' for name in RELOADS),
          fates=('kept last', 'kept 1', 'sts last')),
    Scene('little gets', _plant(), slots=(1.2,), fates_of='f', first='speed bare',
          events=('reload same', 'guest speed', 'message'),
          fates=('kept last', 'kept 1', 'sts last'), meets=('reload same', 'unplug 0.5')),
    Scene('little again', _plant(after=1500), slots=(1.3,), until=2.4, equals=(1.2, 1.6),
          rows=_AGAIN,
          events=('equal', 'message', 'guest speed', 'overwrite', 'program 0.5', 'silent 0.7',
                  'reload same', 'polling 0.4'),
          fates=('no reply', 'refused', 'kept last', 'kept 1', 'sts last')),
    Scene('little again via', _plant('Gateway', after=1500), slots=(0.05, 1.3), until=2.4,
          equals=(0.94, 1.2, 1.6), rows=_AGAIN,
          events=('before speed last', 'guest speed', 'guest unknown'),
          fates=('not delivered', 'told undelivered', 'kept last')),
    Scene('little bits', _plant(kind='SLC'), slots=(0.9, 1.3), until=2.4, rows=_bits,
          called=('w0_1', 'free_1'), fates_of='fw',
          events=('publish free_1', 'message', 'reload same'),
          fates=('no reply', 'kept last', 'kept 1')),
    Scene('little long', _plant(kind='SLC'), slots=(0.9, 1.35), until=2.4,
          rows=_long, events=('message', 'guest speed', 'still 0.4', 'polling 0.4'),
          fates=('no reply', 'lost', 'refused', 'kept last', 'kept 1')),
    Scene('little clocks', _plant(), _CALLED, (0.7, 1.1, 1.7), until=2.4,
          events=('ahead 0.06', 'ahead 0.3', 'set 1.0', 'set -1.0', 'still 0.4', 'message 0.5')),
    Scene('little refreshed', _plant(), slots=(0.6, 1.75), until=2.4, is_refreshed=True,
          events=('overwrite', 'guest speed', 'guest unknown', 'silent 0.7', 'message'),
          fates=('no reply', 'refused', 'kept last')),
    Scene('little unread', _plant(), slots=(0.3, 1.35, 1.8), fates_of='h', until=2.4,
          is_read_back=False, events=('guest beat', 'message', 'silent 0.7', 'program 3.0'),
          fates=('no reply', 'refused', 'kept last', 'kept 1')),
    Scene('little two', _plant('Message', stations=2), slots=(0.9, 1.75), called=_BOTH,
          until=2.4, equals=(1.2,), rows=_AGAIN,
          events=('guest speed 255', 'guest speed 2', 'silent 0.7', 'reload same', 'end 0.3'),
          fates=('no reply', 'kept last', 'sts 1')),
    Scene('little hang', _plant(requires=None, period=1500), (), (0.8, 1.75), fates_of='h',
          until=2.4, given={'at 0.05': 'executor 2.4'}, is_read_back=False,
          events=('guest beat', 'guest speed', 'reload same'), fates=('no reply', 'kept last')),
    Scene('little zero', _plant(), (0.8, 1.1, 1.4, 2.05, 2.4, 2.8), (1.9, 2.2), fates_of='h',
          until=2.6, is_read_back=False, events=('guest beat', 'polling 0.4'),
          fates=('no reply', 'kept last')),
    Scene('little last', _plant(), slots=(1.0, 1.25), given={'at 1.35': 'reload same'},
          fates_of='fgh', until=2.4, events=('message', 'guest speed', 'silent 0.7'),
          fates=('no reply', 'refused', 'kept last', 'sts 1')),
    Scene('little late', _plant(), first='speed bare', slots=(1.3,), fates_of='g', until=2.4,
          given={'at 1.0': 'guest speed', 'at 1.6': 'reload same'}, events=('guest speed',),
          fates=('no reply', 'kept last', 'kept 1')),
    Scene('little back', _plant('Gateway'), slots=(1.25, 1.6), fates_of='f', until=2.4,
          given={'at 1.0': 'polling 0.4'},
          events=('before speed last', 'before beat last', 'message'),
          fates=('not delivered', 'kept last')),
    Scene('little away', _plant(), slots=(1.25,), until=1.0, given={'at 1.0': 'polling 0.4'},
          events=('overwrite', 'message'), fates=('no reply',)),
    Scene('little race', _plant(), (), (0.5, 0.53), fates_of='f', until=2.0,
          given={'at 0.55': 'polling 0.4'}, events=('slow 0.04', 'guest speed', 'message'),
          fates=('no reply', 'kept last')),
    Scene('little calls', _plant(after=8000), _slots(0.3, 5.2, 0.35), (1.7,), until=2.4,
          fates_of='fh', given={'write 1': 'no reply', 'write 2': 'no reply'},
          events=('guest speed',), fates=('no reply', 'refused')),
    Scene('little crowd', _plant(), slots=(0.78, 0.9, 1.3), fates_of='f', until=2.4,
          events=('crowd 0.5', 'message', 'kill 0.3', 'reload same', 'polling 0.4'),
          fates=('no reply', 'kept last'), meets=('crowd 0.1',)),
    Scene('little stored', _plant(may_store=True), slots=(0.4, 0.95, 1.75), until=2.4,
          events=('queued 0.7', 'message', 'guest speed', 'reload same'), fates=('no reply',)),
    Scene('little radio', _plant('Radio'), slots=(0.9, 1.75), until=2.4,
          events=('guest speed', 'silent 0.7', 'polling 0.4', 'kill 0.3'),
          fates=('no reply', 'lost', 'kept last')),
    Scene('little standard', _plant('Standard', baud=9600), slots=(0.9, 1.75), until=2.4,
          events=('guest speed', 'silent 0.7', 'reload same'), fates=('no reply', 'kept last')),
    Scene('little slave', _plant('Slave', baud=19200, stations=2), slots=(0.9, 1.75), until=2.4,
          rows=_AGAIN, called=(*_BOTH, 'served'), equals=(1.4,),
          events=('guest speed', 'silent 0.7', 'reload same'), fates=('no reply', 'sts last')))
SCENES = {scene.name: scene for scene in (*_SMALL, *_LARGE)}
SMALL = tuple(scene.name for scene in _SMALL)


class Kind(Enum):
    """A kind of row, or what else writes its words."""

    FALLBACK = 'a row with Fallback'
    HEARTBEAT = 'a heartbeat with While'
    READ_WRITE = 'a ReadWrite row'
    AGAIN = 'a row with Write_Again'
    GUEST = "a guest's words"
    GATEWAY = 'a row behind a gateway'
    SERVED = 'a Serve row'
    STATIONS = 'two stations'


def kinds_of(scene: Scene) -> set[Kind]:
    """Return all kinds of a scene."""
    rows = scene.rows(scene.plant.mappings())
    options = {*scene.events, *scene.meets, *scene.fates}
    found = {
        Kind.FALLBACK: any(row.fallback and not row.serves for row in rows),
        Kind.HEARTBEAT: any(row.is_heartbeat and row.condition for row in rows),
        Kind.READ_WRITE: any(row.polls and row.writes for row in rows),
        Kind.AGAIN: any(row.write_again for row in rows),
        Kind.GUEST: any(option.startswith('guest') for option in options),
        Kind.GATEWAY: scene.plant.gateway or any(
            option.startswith(('sts', 'not', 'told')) for option in options),
        Kind.SERVED: any(row.serves for row in rows),
        Kind.STATIONS: scene.plant.stations > 1}
    return {kind for kind, is_there in found.items() if is_there}
