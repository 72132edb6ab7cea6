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

"""The tables of the documentation that repeat what is in the code."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from pathlib import Path
import re
from typing import Any

from abdf1_ros.counters import numbered
from abdf1_ros.df1.frames import Code
from abdf1_ros.diagnosis.causes import diagnose, RULES
from abdf1_ros.driver.guest_rules import right_for
from abdf1_ros.driver.kernel.reasons import IN_ORDER
from abdf1_ros.messages import Message, Severity
from abdf1_ros.numbers import ValueKind
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.describe import command_codes, known_commands
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.families import dialect_of, FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.members import Members
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import Meanings, status_text, USUAL_MEANINGS
from abdf1_ros.pccc.targets import CLOCK_WORDS, Target
from abdf1_ros.pccc.values import types_of
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.columns import MAP_COLUMNS
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.network import FIELDS, load_network, Network

from tools.explanations import COUNTERS, MESSAGES, OUTCOMES
from tools.rooms import ROOMS

CONFIG = Path(__file__).resolve().parent.parent / 'config'

NAMES = {PlcType.PLC5: 'PLC-5', PlcType.SLC: 'SLC, MicroLogix', PlcType.PLC3: 'PLC-3',
         PlcType.PLC2: 'PLC-2'}
_5, _S, _3, _2 = NAMES

# Sample places of each kind, by family; all places of a kind have the same types.
PLACES: tuple[tuple[str, dict[PlcType, str]], ...] = (
    ('O output', {_5: 'O:017', _S: 'O:2.0', _3: 'O:0017'}),
    ('I input', {_5: 'I:003', _S: 'I:1.0', _3: 'I:0017'}),
    ('S status', {_5: 'S:1', _S: 'S:1', _3: 'S:3'}),
    ('B binary', {_5: 'B3:1', _S: 'B3:1', _3: 'B10:5', _2: '020'}),
    ('N integer', {_5: 'N7:0', _S: 'N7:0', _3: 'N7:0'}),
    ('F float', {_5: 'F8:0', _S: 'F8:0'}),
    ('L long', {_S: 'L10:0'}),
    ('A ASCII', {_5: 'A10:0', _S: 'A10:0', _3: 'A1:0'}),
    ('D BCD', {_5: 'D11:0', _S: 'D11:0', _3: 'D1:0'}),
    ('ST string', {_5: 'ST9:0', _S: 'ST9:0'}),
    ('T timer', {_5: 'T4:0.ACC', _S: 'T4:0.ACC', _3: 'T:4.ACC'}),
    ('C counter', {_5: 'C5:0.PRE', _S: 'C5:0.PRE', _3: 'C:9.PRE'}),
    ('R control', {_5: 'R6:0.LEN', _S: 'R6:0.LEN'}),
    ('PD of a PLC-5', {_5: 'PD10:0.SP'}),
    ('PD of an SLC', {_S: 'PD9:0.SPS'}),
    ('MG message', {_5: 'MG12:0.ERR', _S: 'MG12:0.ERR'}),
    ('BT block transfer', {_5: 'BT13:0.RLEN'}),
    ('SC SFC status', {_5: 'SC14:0.PRE'}),
    ('HSC function', {_S: 'HSC:0.ACC'}),
    ('STI function', {_S: 'STI:0.SPM'}),
    ('EII function', {_S: 'EII:0.IS'}),
    ('PTO, PWM function', {_S: 'PTO:0'}),
    ('a bit', {_5: 'B3:1/5', _S: 'B3:1/5', _3: 'B10:5/03', _2: '110/17'}),
    ('a bit by number', {_5: 'B3/21', _S: 'B3/21'}),
    ('a bit of I/O', {_5: 'I:017/12', _S: 'I:1.0/3', _3: 'I:0017/07'}),
    ('a bit of a structure', {_5: 'T4:0/DN', _S: 'T4:0/DN', _3: 'T:4/DN'}),
)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, ['---'] * len(header), *rows]
    return '\n'.join('| ' + ' | '.join(cell.replace('|', '\\|') for cell in line) + ' |'
                     for line in lines)


def _code(text: str) -> str:
    return f'`{text}`' if text else ''


def _linked(text: str) -> str:
    """Turn the numbers of messages into links."""
    return re.sub(r'\b(25[0-5][0-9])\b', r'[\1](messages.md#\1)', text)


def net_fields() -> str:
    """Return the columns of the net CSV."""
    return table(
        ('column', 'default', 'values', 'meaning', 'error'),
        ((FIELDS[name].column, str(value), _values(FIELDS[name].kind), FIELDS[name].description,
          _linked(str(message.number)) if (message := FIELDS[name].message) else '')
         for name, value in Network().cells().items()))


def _values(kind: ValueKind[Any]) -> str:
    if kind.choices:
        return ', '.join(kind.choices)
    return '' if kind.low is None else f'{kind.low}-{kind.high}'


def map_columns() -> str:
    """Return the columns of the map CSV."""
    return table(('column', 'empty cell', 'meaning'), (
        (column.name, 'not allowed' if column.default is None else column.default,
         column.description) for column in MAP_COLUMNS))


def parameters() -> str:
    """Return the node's own parameters; needs rclpy."""
    from abdf1_ros.ros.parameters.declared import Parameters
    rows = []
    for entry in fields(Parameters):
        low, high = entry.metadata['low'], entry.metadata['high']
        limits = ', '.join(entry.metadata['choices']) if low is None \
            else f'{low:.15g} to {high:.15g}'
        rows.append((_code(entry.name), _default(entry.default), limits,
                     entry.metadata['description']))
    return table(('parameter', 'default', 'range', 'meaning'), rows)


def _default(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def addresses() -> str:
    """Return address, file, types and message of every kind of place; needs rclpy."""
    from abdf1_ros.ros.topics.messages import MESSAGES as TOPIC_TYPES
    rows = []
    for label, examples in PLACES:
        parsed = [parse_address(text, plc_type) for plc_type, text in examples.items()]
        kinds = types_of(parsed[0])
        assert all(types_of(address) == kinds for address in parsed), label
        rows.append((
            label, *(_code(examples.get(plc_type, '')) for plc_type in NAMES),
            kinds[0].value, ', '.join(kind.value for kind in kinds[1:]),
            TOPIC_TYPES[kinds[0]].__name__))
    return table(('file', *NAMES.values(), 'type', 'Type may also be', 'message'), rows)


def members() -> str:
    """Return the named parts of the structures."""
    rows = []
    for plc_type, family in NAMES.items():
        for kind in FAMILIES[plc_type].file_types:
            parts = FAMILIES[plc_type].layout(kind).members
            if parts:
                rows.append((family, kind.value, _names(parts, False), _names(parts, True)))
    return table(('family', 'file', 'values', 'bits'), rows)


def _names(parts: Members, bits: bool) -> str:
    return ' '.join(name if part.writable else f'({name})' for name, part in parts.items()
                    if (part.bit is not None) is bits)


def packets() -> str:
    """Return the words per packet, and the files that a processor lacks."""
    ways: list[tuple[str, Dialect, str]] = [
        ('PLC-5', dialect_of(PlcType.PLC5), ''),
        ('PLC-5, Access WordRange', dialect_of(PlcType.PLC5, Access.WORD_RANGE), ''),
        *((f'SLC, Processor {processor.value}', dialect_of(PlcType.SLC, None, processor),
           _lacking(processor)) for processor in Processor),
        ('PLC-3', dialect_of(PlcType.PLC3), ''),
        ('PLC-2', dialect_of(PlcType.PLC2), '')]
    return table(('PLC', 'words read', 'words written', 'files it does not have'), (
        (name, *(str(limit(FileType.BINARY)) for limit in (way.max_read, way.max_write)), lacking)
        for name, way, lacking in ways))


def _lacking(processor: Processor) -> str:
    return ' '.join(kind.value for kind in FAMILIES[PlcType.SLC].file_types
                    if not any(processor.has_file(file, kind) for file in range(256)))


def messages(severity: Severity) -> str:
    """Return the numbered messages of one severity, each with cause and cure."""
    return table(('number', 'message', 'cause', 'what to do'), (
        (f'<a id="{entry.number}"></a>{entry.number}',
         f'{entry.name}: {_code(entry.template)}',
         _linked(MESSAGES[entry].cause), _linked(MESSAGES[entry].cure))
        for entry in Message if entry.severity is severity))


def causes() -> str:
    """Return the causes of a missing answer, each with the texts for its example."""
    return table(('seen', 'cause', 'next', '`plc` asks before'), (
        (rule.seen, found.cause, found.step, rule.asks.value if rule.asks else '')
        for rule in RULES for found in (diagnose(rule.example),)))


def counters() -> str:
    """Return the status counters."""
    return table(('number', 'counter', 'counts', 'what it tells'), (
        (str(entry.metadata['number']), entry.metadata['mnemonic'],
         entry.metadata['description'], _linked(COUNTERS[entry.name]))
        for entry in numbered()))


def write_reasons() -> str:
    """Return why a message is not taken, in the order of the reasons."""
    return '\n'.join(f'{number}. {words}' for number, words in enumerate(IN_ORDER, 1))


def outcomes() -> str:
    """Return the outcomes of a write."""
    return table(('the message begins with', 'meaning'), (
        (_code(outcome.value), text) for outcome, text in OUTCOMES.items()))


_SYMBOL_USES = {
    Code.SOH: "a master's message begins", Code.STX: 'data begin', Code.ETX: 'data end',
    Code.EOT: 'nothing to send (slave)',
    Code.ENQ: 'poll (half duplex); say your last response again (full duplex)',
    Code.ACK: 'message taken', Code.NAK: 'message refused (full duplex); reset (half duplex)'}


def symbols() -> str:
    """Return the control symbols of the line."""
    return table(('symbol', 'bytes', 'says'), (
        (f'DLE {code.name}', _code(f'10 {code:02X}'), text)
        for code, text in _SYMBOL_USES.items()))


def file_codes() -> str:
    """Return the file types of SLC commands."""
    types = (kind for kind in FAMILIES[PlcType.SLC].file_types)
    return table(('file', 'type'), (
        (kind.value, _code(f'{layout.code:02X}')) for kind in types
        if (layout := FAMILIES[PlcType.SLC].layout(kind)).code))


def statuses() -> str:
    """Return the meaning of every STS and EXT STS, with special meanings in a family."""
    codes: list[tuple[int, int | None]] = [
        (sts, None) for sts in (*range(1, 16), *range(16, 256, 16))]
    codes += [(0xF0, ext) for ext in range(1, 256)]
    own = {NAMES[kind]: family.meanings for kind, family in FAMILIES.items()
           if family.meanings is not USUAL_MEANINGS}
    rows = []
    for sts, ext in codes:
        usual = _meaning(sts, ext)
        others = [_meaning(sts, ext, meanings) for meanings in own.values()]
        if any('unknown code' not in text for text in (usual, *others)):
            rows.append([_code(f'{sts:02X}' if ext is None else f'{sts:02X} {ext:02X}'), usual,
                         *('' if text == usual else text for text in others)])
    return table(('STS', 'meaning', *own), rows)


def _meaning(sts: int, ext: int | None, meanings: Meanings = USUAL_MEANINGS) -> str:
    return status_text(sts, ext, meanings).partition(': ')[2]


def commands() -> str:
    """Return every command that we know by name."""
    return table(('CMD', 'FNC', 'name'), (
        (_code(f'{cmd:02X}'), '' if function is None else _code(f'{function:02X}'), name)
        for (cmd, function), name in command_codes().items()))


def bounds() -> str:
    """Return the times of the heartbeat and the fallbacks in config/ for several settings."""
    network = load_network(str(CONFIG / 'net.csv'))
    mappings, _ = load_mappings(str(CONFIG / 'heartbeat_map.csv'))

    def row(timeout: int, cmd_timeout: int, retries: int) -> list[str]:
        """Return the cells of a row for these settings."""
        settings = replace(network, timeout=timeout, cmd_timeout=cmd_timeout,
                           nak_retries=retries, enq_retries=retries)
        message, standard = (make_report(replace(settings, polling=polling), mappings, 0.1)
                             for polling in ('Message', 'Standard'))
        presets, = {bound.presets for bound in message.times.bounds() if bound.presets}
        longest, usual, polled = (max(filter(None, times)) for times in (
            [bound.seconds for bound in message.times.bounds() if bound.mapping.fallback],
            [bound.usual for bound in message.times.bounds()],
            [bound.seconds for bound in standard.times.bounds() if bound.mapping.fallback]))
        return [f'{timeout}, {cmd_timeout}, {retries}', f'{message.times.longest:.2f} s',
                f'{presets[0]}, {presets[1]}', f'{longest:.1f} s', f'{polled:.1f} s',
                f'{usual:.1f} s']

    return table(('Timeout, Cmd_Timeout, retries', 'T', 'rung 3, rung 5', 'fallback, at most',
                  'with Polling Standard', 'no frame lost'),
                 [row(100, 500, 1), row(200, 500, 1), row(300, 1000, 3), row(1000, 1000, 3)])


def rooms() -> str:
    """Return the contents of each room, and the imports that it may have."""
    return table(('room', 'what is in it', 'may import'), (
        (', '.join(map(_code, room.name.split(', '))), room.contents,
         'everything' if room.allowed is None else ', '.join(map(_code, room.allowed))
         or 'nothing of the package') for room in ROOMS))


def rights() -> str:
    """Return the right that each command of a guest needs, for each target that it can have."""
    groups: dict[tuple[str, Effect, tuple[Target, ...]], list[str]] = {}
    for (cmd, function), command in known_commands().items():
        code = f'`{cmd:02X}`' if function is None else f'`{cmd:02X}/{function:02X}`'
        reach = command.reach
        groups.setdefault((reach.form, command.effect, reach.kinds), []).append(code)
    rows = []
    for (form, effect, kinds), codes in sorted(
            groups.items(), key=lambda group: (not group[0][0], group[0][0])):
        for kind in kinds:
            right, name = right_for(effect, kind), kind.value
            if Target.CLOCK not in kinds or right is right_for(
                    effect, Target.STATUS) is right_for(effect, Target.CLOCK):
                if kind is Target.CLOCK:
                    continue  # no difference from the other words
                name = name.removeprefix('other ')
            elif kind is Target.CLOCK:
                name += f' ({_clocks(form)})'
            rows.append((form or 'any', ', '.join(codes), name, f'`{right.value}`'))
    rows += [('any', 'any other, and one that is malformed', Target.OTHER.value, '`All`'),
             ('any', 'any to all stations (DST 255)', 'all that hear it', '`All`')]
    return table(('PLC', 'command', 'it addresses', '`Share_Access`'), rows)


def _clocks(form: str) -> str:
    """Return the words of the clocks that commands with this form of address reach."""
    clocks = [FAMILIES[kind].addressing.parse(FAMILIES[kind].clock)
              for kind in (PlcType.PLC5, PlcType.SLC)]
    return ', '.join(
        f'{clock.addressing.title} {clock} to {clock.at_offset(clock.offset + CLOCK_WORDS - 1)}'
        for clock in clocks if clock.addressing.title in form or NAMES[PlcType.PLC5] in form)
