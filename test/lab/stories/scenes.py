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
from dataclasses import dataclass, replace

from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.mapping import Mapping
from support.world import Plant

DIRECT = ('no reply', 'lost', 'refused')
KEPT = ('kept last', 'kept 1', 'kept 2', 'sts last', 'sts 1', 'sts 2')
GATEWAY = (*DIRECT, 'not delivered', 'told undelivered', *KEPT)
BEFORE = tuple(f'before {word} {when}'
               for word in ('speed', 'beat') for when in ('1', '2', 'last'))


def _without(*tags: str) -> Callable[[list[Mapping]], list[Mapping]]:
    return lambda rows: [row for row in rows if row.tag not in tags]


def _changed(tag: str, **changes: object) -> Callable[[list[Mapping]], list[Mapping]]:
    return lambda rows: [replace(row, **changes) if row.tag == tag else row  # type: ignore
                         for row in rows]


RELOADS: dict[str, Callable[[list[Mapping]], list[Mapping]]] = {
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
    writes.
    """

    name: str
    plant: Plant
    messages: tuple[float, ...] = (0.8,)
    slots: tuple[float, ...] = ()
    events: tuple[str, ...] = ()
    fates: tuple[str, ...] = ()
    fates_of: str = 'fg'
    meets: tuple[str, ...] = ()
    first: str = 'same'  # of RELOADS: the rows before the first reload


def _plant(mode: str = 'Peer', **others: object) -> Plant:
    usual = Plant(mode, rows=1, baud=38400, after=700, period=500, requires=600)
    return replace(usual, **others)  # type: ignore[arg-type]


def _slots(first: float = 0.05, last: float = 3.4, step: float = 0.3) -> tuple[float, ...]:
    return tuple(round(first + step * at, 2) for at in range(int((last - first) / step) + 1))


_CALLED = (0.8, 1.2, 1.6)
_FREE = _plant(requires=None)  # its heartbeat counts without messages

_LARGE = (
    Scene('direct', _plant(), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('sts', _plant(), _CALLED, _slots(), (*EVENTS, *BEFORE), GATEWAY, 'fgh'),
    Scene('via', _plant('Gateway'), _CALLED, _slots(), (*EVENTS, *BEFORE), GATEWAY, 'fgh'),
    Scene('meets', _plant('Gateway'), _CALLED, fates=GATEWAY, fates_of='fgh', meets=EVENTS),
    Scene('master', _plant('Message'), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('standard', _plant('Standard'), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('radio', _plant('Radio'), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('stored', _plant(may_store=True), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
    Scene('two', _plant('Message', stations=2), _CALLED, _slots(), EVENTS, DIRECT, 'fgh'),
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
          events=('program 3.0', 'download 3.0', 'silent 0.7', 'message', 'polling 0.4'),
          fates=DIRECT),
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
          fates=('kept last', 'kept 1', 'sts last'), meets=('reload same', 'unplug 0.5')))
SCENES = {scene.name: scene for scene in (*_SMALL, *_LARGE)}
SMALL = tuple(scene.name for scene in _SMALL)
