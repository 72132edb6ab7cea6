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
One story of a plant: events in their time, writes that end otherwise, and the rules at each step.

At the end all is well again, and waits until nothing is under way: then each word has to hold
what the driver believes, and messages are written and heartbeats count again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from collections.abc import Mapping as MappingType
from dataclasses import dataclass
from functools import partial
import math
from unittest import mock

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.kernel.fallback import FallbackState
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.errors import CLOSED
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.plan.bounds import MODE_PERIOD
from abdf1_ros.settings.heartbeats import HAND_OVER, LONGEST_END
from abdf1_ros.settings.mapping import Mapping
from simulate.rules import Broken, Judge
from stories.scenes import RELOADS, Scene
from support.world import (
    Execute,
    GUESTS,
    is_write,
    OTHERS,
    SAFE,
    STEP,
    WatchedPlc,
    World,
)

_SPEED = 'w0_1'
_TAGS = {'speed': _SPEED, 'beat': 'beat_1'}  # as events name them
_FROM_BEFORE = GUESTS[-20:]  # what other programs wrote before the port was opened
_LONGEST = 12.0  # s without anything new, until all is at rest
_LAST = 0.03  # s before a write can land no more
_GLANCE = 0.01  # s
_COUNTS_WITHIN = 3.0  # s, and the time of a transaction: two tries, a pause, a 0 that stands
_REFRESHED = 3.0  # s after which each Fallback that stands has been written again
# Messages until all is as at first; and as long as a clock that was ahead is remembered, or a 0
# stands after a foreign value.
_CALLS, _CALLS_LONG = 12, 42
_RECOVERED = 2  # deviations from which on nobody looks whether all is as at first: it takes long


class Pointless(Exception):
    """A deviation changes nothing: the story is the same as one without it."""


@dataclass(slots=True, eq=False)
class Kept:
    """A write that a gateway keeps; it lands ``after`` so many own writes of the word, or last."""

    command: Packet
    execute: Execute
    tag: str
    after: int
    driver: int
    is_done: bool = False


class Telling:
    """
    Tell one story, from its first message until all is at rest; raise Broken.

    ``points`` are the moments in which it may go another way, with the ways.
    """

    def __init__(self, scene: Scene, story: MappingType[str, str]) -> None:
        self.scene = scene
        self.points: list[tuple[str, tuple[str, ...]]] = []
        self.world = World(scene.plant, 1, lambda rows: RELOADS[scene.first](scene.rows(rows)))
        self._places = {row.tag: row.address for row in scene.rows(scene.plant.mappings())}
        self.world.pass_on, self.world.may_land = self._pass_on, self._may_land
        self._judge = Judge(self.world)
        self._story = story
        self._writes = 0
        self._forgotten = 0  # messages of processes that were killed
        self._first_driver = 0  # of this process
        self._dead_until = -math.inf
        self._is_gateway_known = bool(scene.plant.gateway)  # or it has shown itself by an STS
        self._kept: list[Kept] = []
        self._executes: dict[int, Execute] = {}  # by station, once it has executed something
        self._ill_until = -math.inf
        self._last_news = self._mode_seen_at = 0.0
        self._calls = _CALLS
        self._counted_at = 0.0  # that heartbeats did, or need not

    def came(self) -> Iterator[str]:
        """Return what PLCs have executed, and then all results and refusals of own writes."""
        for entry in self.world.executed:
            yield f'{entry.tag} = {entry.value}{" late" * entry.is_late}'
        for result in self.world.results:
            yield f'{result.mapping.tag} {result.value}: {result}'
        for place, reason in self.world.listener.reasons:
            if reason.startswith('not written'):
                yield f'{place} {reason}'

    def tell(self) -> None:
        """Let it all happen."""
        scene, world = self.scene, self.world
        for when in scene.messages:
            world.at(when, self._publish)
        for when in scene.equals:
            world.at(when, self._publish_equal)
        for where, what in scene.given.items():
            if where.startswith('at '):
                world.at(float(where[len('at '):]), partial(self._do, what))
        for when in scene.slots:
            world.at(when, partial(self._event, f'at {when}', scene.events))
        self._wait(max((*scene.messages, *scene.equals, *scene.slots)) + STEP)
        while why := self._why_unsettled():
            if world.line.now > self._last_news + _LONGEST + scene.plant.after / 1000:
                raise Broken('Rest', f'not at rest: {why}', world)
            self._wait(STEP)
        self._demand_belief()
        if len(self._story) < _RECOVERED:
            self._recover()

    # How it goes on

    def _publish(self) -> None:
        for row in self.world.rows.values():
            if row.tag in self.scene.called:
                self.world.publish(row)

    def _publish_equal(self) -> None:
        if row := self.world.rows.get(_SPEED):
            self.world.publish(row, is_equal=True)

    def _wait(self, seconds: float) -> None:
        world = self.world
        end = world.line.now + seconds - STEP / 2
        while world.line.now < end:
            if world.line.now < self._ill_until:
                self._mark()
            world.run(STEP)
            self._judge.look()
            self._demand_count()

    def _demand_count(self) -> None:
        """Demand that heartbeats count soon while messages come and nothing is wrong (3, 11)."""
        world, now = self.world, self.world.line.now
        missing = [row.tag for row in world.rows.values()
                   if row.is_heartbeat and world.plcs[row.station].held(row) == 0
                   and row.condition and row.condition.names]
        needed = (world.plant.requires or 0) / 1000
        is_well = world.driver.is_online and self._calls == _CALLS \
            and not world.driver.kernel.end.is_asked and all(
                now < world.came.get(tag, -math.inf) + needed for tag in self.scene.called)
        if not missing or not is_well:
            self._counted_at = now
        since = max(self._counted_at, self._ill_until, self._last_news, self._mode_seen_at,
                    world.opened)
        if now > since + _COUNTS_WITHIN + world.longest:
            raise Broken('Counts', f'{missing} stand still, and nothing is wrong', world)

    def _mark(self, seconds: float = 0.0) -> None:
        """Keep that something is wrong, for so many seconds: no bound holds then."""
        world, now = self.world, self.world.line.now
        self._ill_until = max(self._ill_until, now + seconds)
        self._last_news = max(self._last_news, self._ill_until)
        world.ill[0] = world.ill[1] = now

    def _cut_off(self) -> None:
        """Keep that a PLC may wait for the ACK to a reply: it answers nothing meanwhile."""
        self._mark(self.world.far.answers_again + STEP)

    def _choose(self, where: str, options: Sequence[str]) -> str:
        self.points.append((where, tuple(options)))
        return self._story.get(where, '') or self.scene.given.get(where, '')

    def _event(self, where: str, options: Sequence[str]) -> None:
        if event := self._choose(where, options):
            self._do(event)

    def _do(self, event: str) -> None:
        self._last_news = max(self._last_news, self.world.line.now)
        name, _, argument = event.partition(' ')
        _EVENTS[name](self, argument)

    # What becomes of a write

    def _pass_on(self, watched: WatchedPlc, execute: Execute, command: Packet) -> Packet:
        """Let a write have its fate."""
        station = watched.plc.station
        self._executes[station] = execute
        if not is_write(command) or watched.lacks(command):
            return execute(command)
        meant = self.world.forms.meant(station, command.data)
        tag, value = meant[:2] if meant else ('', int.from_bytes(command.data[-2:], 'little'))
        kind = 'g' if value in GUESTS else {'w': 'f', 'b': 'h'}.get(tag[:1], 'w')
        fate = ''
        if kind in self.scene.fates_of and self.world.line.now < self.scene.until:
            self._writes += 1
            fate = self._choose(f'write {self._writes}', self.scene.fates)
            if self.scene.meets and (event := self._choose(
                    f'during {self._writes}', self.scene.meets)):
                self.world.at(self.world.line.now + 0.001, partial(self._do, event))
        if not fate:
            return self._carry_out(tag, value, execute, command)
        self._mark()
        way, _, when = fate.partition(' ')
        self._is_gateway_known |= way in ('not', 'told', 'sts')
        if way in ('kept', 'sts'):
            self._keep(Kept(command, execute, tag, 0 if when == 'last' else int(when),
                            self.world.drivers))
        reply = execute(command) if fate in ('no reply', 'told undelivered') \
            else command.reply(sts=_STATUS.get(way, 0x00))
        if fate == 'told undelivered':
            return command.reply(sts=0x05)
        # Nobody waits for a reply with this number.
        return reply if way in _STATUS else reply._replace(tns=reply.tns ^ 0x8000)

    def _carry_out(self, tag: str, value: int, execute: Execute, command: Packet) -> Packet:
        reply = execute(command)
        if value in (0, SAFE):
            for kept in self._kept:
                if kept.after and kept.tag == tag:
                    kept.after -= 1
                    if not kept.after:
                        self.world.at(self.world.line.now + 0.002, partial(self._land, kept))
        return reply

    def _keep(self, kept: Kept) -> None:
        """Let a gateway keep a write, at most as long as rule 10 says after the write's end."""
        self._kept.append(kept)
        self.world.at(self.world.line.now + _GLANCE, partial(self._watch_end, kept))

    def _watch_end(self, kept: Kept) -> None:
        world = self.world
        is_under_way = kept.driver == world.drivers and any(
            job.command.tns == kept.command.tns for job in world.driver.tasks.under_way)
        if is_under_way:
            world.at(world.line.now + _GLANCE, partial(self._watch_end, kept))
        else:
            world.at(world.line.now + world.held_for - _LAST, partial(self._land, kept))

    def _may_land(self, tag: str, value: int) -> bool:
        """Tell whether a gateway keeps another value of a row, and the driver can know of it."""
        return any(kept.tag == tag and not kept.is_done
                   and int.from_bytes(kept.command.data[-2:], 'little') != value
                   and (kept.driver >= self._first_driver or self._is_gateway_known)
                   for kept in self._kept)

    def _land(self, kept: Kept) -> None:
        if not kept.is_done:
            kept.is_done = True
            self._last_news = max(self._last_news, self.world.line.now)
            kept.execute(kept.command, is_late=True)

    # What people and programs do

    def publish(self, argument: str) -> None:
        """Publish a message, which may be so many seconds old."""
        self._say(_SPEED, float(argument or 0.0))

    def publish_equal(self, argument: str) -> None:
        """Publish the last message once more."""
        self._say(_SPEED, is_equal=True)

    def publish_other(self, tag: str) -> None:
        """Publish a message of another row."""
        self._say(tag)

    def publish_slowly(self, argument: str) -> None:
        """Publish a message whose thread stands still so long after it was found to be good."""
        inbox, world = self.world.driver._inbox, self.world  # noqa: SLF001
        put = inbox.put

        def put_late(write: Write) -> bool:
            world.at(world.line.now + float(argument), partial(put, write))
            return True

        with mock.patch.object(inbox, 'put', put_late):
            self._say(_SPEED)

    def _say(self, tag: str, late: float = 0.0, *, is_equal: bool = False) -> None:
        if tag not in self.world.rows:
            raise Pointless
        self.world.publish(self.world.rows[tag], late, is_equal=is_equal)

    def be_ahead(self, argument: str) -> None:
        """Let the clock of the publishers be ahead by so many seconds, for a second."""
        self.world.clocks.lead = float(argument)
        self._calls = _CALLS_LONG
        self.world.at(self.world.line.now + 1.0, lambda: setattr(self.world.clocks, 'lead', 0.0))

    def set_clock(self, argument: str) -> None:
        """Set the clock of the host by so many seconds."""
        self.world.clocks.set(float(argument), self.world.line.now)

    def ask(self, argument: str) -> None:
        """Let a guest write a word, or what nobody knows."""
        world = self.world
        if not world.driver.is_online or world.line.now < self._dead_until:
            raise Pointless
        if argument == 'unknown':
            world.command(1, 0x0F, b'\x68\0\0')
            return
        where, _, station = argument.partition(' ')
        address = self._places[_TAGS[where]]
        dialect = world.rows['clock_1'].dialect  # the row of the word may be gone
        world.command(int(station or 1), *dialect.write(
            address, world.next_of_guests.to_bytes(2, 'little')))

    def deliver_from_before(self, argument: str) -> None:
        """Let the gateway deliver what another program sent before the port was opened."""
        world = self.world
        left = world.opened + world.held_for - _LAST - world.line.now
        if left <= 0 or not world.driver.is_online or 1 not in self._executes:
            raise Pointless
        dialect = world.rows['clock_1'].dialect
        word, _, when = argument.partition(' ')
        value = _FROM_BEFORE[len(self._kept)]
        cmd, data = dialect.write(self._places[_TAGS[word]], value.to_bytes(2, 'little'))
        self._mark()
        kept = Kept(Packet(1, 77, cmd, 0, 1, data), self._executes[1], _TAGS[word],
                    0 if when == 'last' else int(when), -1)
        self._kept.append(kept)
        world.at(world.line.now + left, partial(self._land, kept))

    def fall_silent(self, argument: str) -> None:
        """Let the PLC answer nothing for so many seconds."""
        self._ail(argument, lambda: self.world.fall_silent(1),
                  lambda: self.world.fall_silent(1, False))

    def stop_program(self, argument: str) -> None:
        """Turn the key to PROGRAM for so many seconds."""
        self._ail(argument, lambda: self._turn(Setting.PROGRAM), self._run_again)

    def download(self, argument: str) -> None:
        """Bring back other words, and run again after so many seconds."""
        watched = self.world.plcs[1]
        watched.saved = dict.fromkeys(watched.places.values(), 7)
        self._ail(argument, lambda: self.world.download(1), self._run_again)

    def stand_still(self, argument: str) -> None:
        """Let the process stand still for so many seconds."""
        self.world.hold_up(float(argument))
        self._mark(float(argument))

    def hang_executor(self, argument: str) -> None:
        """Let no callback run for so many seconds."""
        self._ail(argument, lambda: setattr(self.world, 'is_alive', False),
                  lambda: setattr(self.world, 'is_alive', True))

    def kill(self, argument: str) -> None:
        """Kill the process; another one begins after so many seconds."""
        self._forgotten, self._first_driver = len(self.world.keys), self.world.drivers + 1
        self._is_gateway_known = bool(self.scene.plant.gateway)
        self.world.kill(float(argument))
        self._mark(float(argument))
        self._dead_until = self.world.away

    def overwrite(self, argument: str) -> None:
        """Let another program write the output, unseen: the Fallback is written again for that."""
        self.world.overwrite(1)

    def write_foreign(self, argument: str) -> None:
        """Let another program write once to the heartbeat; the 0 may stand for long after it."""
        self.world.write_foreign(1)
        self._last_news = self._mode_seen_at = self.world.line.now + self.scene.plant.period / 1000
        self._calls = _CALLS_LONG

    def unplug(self, argument: str) -> None:
        """Lose the port for so many seconds."""
        if not self.world.driver.is_online:
            raise Pointless
        self.world.lose_port()
        self._mark(float(argument))
        self._open_again(float(argument))

    def be_queued(self, argument: str) -> None:
        """Connect again to a device server that another client has the line of, for seconds."""
        if not self.world.driver.is_online:
            raise Pointless
        self._ail(argument, self.world.be_queued,
                  lambda: setattr(self.world, 'is_queued', False))

    def crowd(self, argument: str) -> None:
        """Let a second program publish to the output for so many seconds."""
        if _SPEED not in self.world.rows:
            raise Pointless
        self.world.crowd(self.world.rows[_SPEED])
        self.world.at(self.world.line.now + float(argument), self.world.part)

    def end(self, argument: str) -> None:
        """End in order, as after a signal; another process begins so many seconds later."""
        def ended() -> None:
            self.world.lose_port(CLOSED)
            self._judge.look()
            self._judge.over()
            self.kill(argument)

        self._wind_down(LONGEST_END, ended, is_final=True)

    def hand_port_over(self, argument: str) -> None:
        """Give the port to other programs for so many seconds."""
        def ended() -> None:
            self.world.lose_port('released')
            self._open_again(float(argument), is_resumed=True)

        self._wind_down(HAND_OVER, ended)

    def reload(self, argument: str) -> None:
        """Read the files again, whose rows have changed so."""
        def ended() -> None:
            # A PLC whose reply is cut off waits for its ACK, and answers nothing meanwhile.
            if self.world.driver.tasks.under_way and self.world.line.now < until:
                self.world.at(self.world.line.now + _GLANCE, ended)
                return
            self._cut_off()
            self.world.use(rows)

        until = self.world.line.now + HAND_OVER
        rows = RELOADS[argument](self.scene.rows(self.world.plant.mappings()))
        safe = {(row.extent, row.fallback) for row in rows}
        self._wind_down(HAND_OVER, ended, lambda row: (row.extent, row.fallback) not in safe)

    def _open_again(self, seconds: float, *, is_resumed: bool = False) -> None:
        world, process = self.world, self.world.process

        def open_again() -> None:
            if world.process == process and not world.driver.is_online:
                if is_resumed:
                    world.driver.kernel.end.resume()
                self._cut_off()
                world.open()
                world.opened = world.line.now

        world.at(world.line.now + seconds, open_again)

    def _wind_down(self, limit: float, then: Callable[[], None],
                   is_meant: Callable[[Mapping], bool] = lambda row: True, *,
                   is_final: bool = False) -> None:
        """Write all 0s and Fallbacks, wait for them, judge what the log names, and go on."""
        world, driver = self.world, self.world.driver
        if driver.kernel.end.is_asked or world.line.now < world.away or not world.is_alive:
            raise Pointless
        world.ended = world.line.now
        driver.kernel.end.wind_down(is_final=is_final)
        world.line.wake(driver.machine)

        def look() -> None:
            if world.driver is not driver:
                return  # it was killed
            waits = driver.kernel.end.has_to_wait(is_open=driver.is_online, is_meant=is_meant)
            if waits and driver.is_online and world.commands:
                self._demand_no_reads()
            if not waits or world.line.now >= world.ended + limit:
                self._demand_named()
                then()
            else:
                world.at(max(world.away, world.line.now + _GLANCE), look)

        look()

    def _demand_no_reads(self) -> None:
        """Demand that nothing is read at an end (5), but for a read that was under way then."""
        world = self.world
        when, _, command = world.commands[-1]
        is_well = self._ill_until <= world.ended \
            and not any(row.may_rewrite for row in world.rows.values())
        if is_well and when > max(world.ended, world.opened) + STEP and not is_write(command) \
                and not any(command.data == asked.data for asked in world.asked):
            raise Broken('Unread', f'{command} was sent at {when:.3f} (5)', world)

    def _demand_named(self) -> None:
        """Demand that the end names each word that is not safe; none if nothing was wrong (5)."""
        end = self.world.driver.kernel.end
        named = {text.split(' ')[0] for text in (
            *end.unconfirmed(self.world.line.now), *end.not_repeated())}
        is_well = self._ill_until == -math.inf
        for row, value in self._own_words():
            is_told = row.tag in named and not is_well
            if value not in (0, SAFE) and not is_told and not self._is_unknowable(row.tag):
                raise Broken('Named', f'the end does not name {row.tag}, which holds {value} (5)',
                             self.world)

    def _own_words(self) -> Iterator[tuple[Mapping, int]]:
        """Yield the rows of PLCs that we write by ourselves, and what they hold."""
        for row in self.world.rows.values():
            if row.is_own:
                yield row, self.world.plcs[row.station].held(row)

    def _run_again(self) -> None:
        self._turn(Setting.RUN)
        self._last_news = self._mode_seen_at = self.world.line.now + MODE_PERIOD

    def _turn(self, setting: Setting) -> None:
        self.world.plcs[1].set_mode(setting, self.world.line.now)

    def _ail(self, argument: str, begin: Callable[[], None], end: Callable[[], None]) -> None:
        begin()
        self._mark(float(argument))
        self.world.at(self.world.line.now + float(argument), end)

    # How it ends

    def _why_unsettled(self) -> str:
        """Return why the plant is not at rest, empty if it is."""
        world, driver = self.world, self.world.driver
        told = {result.request for result in world.results}
        overwritten = max(world.overwritten.values(), default=-math.inf)
        reasons = {
            'something is wrong': world.line.now <= self._ill_until + 2 * STEP,
            'a mode that is not seen': world.line.now <= self._mode_seen_at + 2 * STEP,
            'a clock': world.clocks.lead,
            'the port': not driver.is_online,
            'an end': driver.kernel.end.is_asked,
            'the gateway': any(not kept.is_done for kept in self._kept),
            'commands': driver.guests.waiting or any(
                is_write(job.command) for job in driver.tasks.under_way),
            'results': any(str(number) not in told
                           for number in range(self._forgotten, len(world.keys))),
            'a fallback': any(row.state is not FallbackState.STANDS or not row.is_confirmed
                              for row in driver.kernel.rows.fallbacks),
            'a heartbeat': any(beat.topics and not beat.is_confirmed
                               for beat in driver.kernel.rows.heartbeats),
            'a refresh': self.scene.is_refreshed and world.line.now < overwritten + _REFRESHED,
            'our table': world.master and self._served not in (None, SAFE)}
        return next((reason for reason, is_so in reasons.items() if is_so), '')

    @property
    def _served(self) -> int | None:
        """Return what the master has read of our output last, None where nobody reads it."""
        return self.world.served[-1][1] if self.world.served else None

    def _is_unknowable(self, tag: str) -> bool:
        """Tell whether a gateway that nobody can know of has delivered a command from before."""
        last = next((entry for entry in reversed(self.world.executed) if entry.tag == tag), None)
        return last is not None and last.is_late and not self._is_gateway_known and (
            last.value in _FROM_BEFORE or last.driver < self._first_driver)

    def _demand_belief(self) -> None:
        """Demand that each word holds what the driver believes: a Fallback, or 0."""
        world = self.world
        for row, value in self._own_words():
            # at an opening, and with refreshes, it is written again (8)
            is_unseen = value == OTHERS and not self.scene.is_refreshed \
                and world.overwritten[row.tag] > max(world.opened, world.killed_at)
            if row.is_heartbeat and not (row.condition and row.condition.names) \
                    or self._is_unknowable(row.tag):
                continue
            if value != (0 if row.is_heartbeat else SAFE) and not is_unseen:
                raise Broken('Belief', f'{row.tag} is at rest for the driver, and holds {value}',
                             world)

    def _recover(self) -> None:
        """Demand that messages are written, and that the heartbeats count."""
        world = self.world
        results, executed = len(world.results), len(world.executed)
        wanted = {row.tag for row in world.rows.values()
                  if row.tag in self.scene.called or row.is_heartbeat}
        for _ in range(self._calls):
            self._publish()
            self._wait(0.35)
            done = {result.mapping.tag for result in world.results[results:]
                    if result.outcome in (Outcome.WRITTEN, Outcome.STANDS)}
            counted = Counter(entry.tag for entry in world.executed[executed:] if entry.value)
            done |= {tag for tag, count in counted.items() if count > 1}
            wanted -= done
            if not wanted and world.line.now > self.scene.until:
                return
        raise Broken('Recovery', f'not written, or does not count: {sorted(wanted)}', world)


_STATUS = {'refused': 0x10, 'not': 0x02, 'sts': 0x02}

_EVENTS: dict[str, Callable[[Telling, str], None]] = {
    'message': Telling.publish, 'equal': Telling.publish_equal, 'publish': Telling.publish_other,
    'slow': Telling.publish_slowly,
    'ahead': Telling.be_ahead, 'set': Telling.set_clock, 'guest': Telling.ask,
    'before': Telling.deliver_from_before, 'overwrite': Telling.overwrite,
    'foreign': Telling.write_foreign,
    'silent': Telling.fall_silent, 'program': Telling.stop_program, 'download': Telling.download,
    'still': Telling.stand_still, 'executor': Telling.hang_executor, 'kill': Telling.kill,
    'crowd': Telling.crowd, 'queued': Telling.be_queued, 'unplug': Telling.unplug,
    'end': Telling.end, 'polling': Telling.hand_port_over, 'reload': Telling.reload}
