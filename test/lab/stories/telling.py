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

from collections.abc import Callable, Iterator, Sequence
from collections.abc import Mapping as MappingType
from dataclasses import dataclass
from functools import partial
import math

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.interlocks.fallback import FallbackState
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.plan.bounds import MODE_PERIOD
from abdf1_ros.settings.heartbeats import HAND_OVER, LONGEST_END
from abdf1_ros.settings.mapping import Mapping
from simulate.rules import Broken, Judge
from stories.scenes import RELOADS, Scene
from support.world import (
    BEAT,
    Execute,
    GUESTS,
    is_write,
    OTHERS,
    OUTPUTS,
    SAFE,
    STEP,
    WatchedPlc,
    World,
)

_SPEED, _BEAT = 'w0_1', 'beat_1'
_FROM_BEFORE = GUESTS[-20:]  # what other programs wrote before the port was opened
_FATES_UNTIL = 4.0  # s
_LONGEST = 12.0  # s without anything new, until all is at rest
_LAST = 0.03  # s before a write can land no more
_GLANCE = 0.01  # s
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
        self.world = World(scene.plant, seed=1, change=RELOADS[scene.first])
        self.world.pass_on = self._pass_on
        self._judge = Judge(self.world)
        self._story = story
        self._writes = 0
        self._forgotten = 0  # messages of processes that were killed
        self._first_driver = 0  # of this process
        self._dead_until = -math.inf
        self._is_gateway_known = bool(scene.plant.gateway)  # or it has shown itself by an STS
        self._kept: list[Kept] = []
        self._execute: Execute | None = None
        self._ill_until = -math.inf
        self._last_news = self._mode_seen_at = 0.0
        self._begins = self._writes_begin()

    def came(self) -> Iterator[str]:
        """Return what PLCs have executed, and then all results."""
        for entry in self.world.executed:
            yield f'{entry.tag} = {entry.value}{" late" * entry.is_late}'
        for result in self.world.results:
            yield f'{result.mapping.tag} {result.value}: {result}'

    def tell(self) -> None:
        """Let it all happen."""
        scene, world = self.scene, self.world
        for when in scene.messages:
            world.at(when, self._publish)
        for when in scene.slots:
            world.at(when, partial(self._event, f'at {when}', scene.events))
        self._wait(max((*scene.messages, *scene.slots)) + STEP)
        while why := self._why_unsettled():
            if world.line.now > self._last_news + _LONGEST:
                raise Broken('Rest', f'not at rest: {why}', world)
            self._wait(STEP)
        self._demand_belief()
        if len(self._story) < _RECOVERED:
            self._recover()

    # How it goes on

    def _publish(self) -> None:
        if row := self.world.rows.get(_SPEED):
            self.world.publish(row)

    def _wait(self, seconds: float) -> None:
        world = self.world
        end = world.line.now + seconds - STEP / 2
        while world.line.now < end:
            if world.line.now < self._ill_until:
                self._mark()
            world.run(STEP)
            self._judge.look()

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
        return self._story.get(where, '')

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
        self._execute = execute
        if not is_write(command):
            return execute(command)
        tag, value = self._meant(command)
        kind = 'g' if value in GUESTS else {'w': 'f', 'b': 'h'}.get(tag[:1], 'w')
        fate = ''
        if kind in self.scene.fates_of and self.world.line.now < _FATES_UNTIL:
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

    def _writes_begin(self) -> dict[str, bytes]:
        """Return how each write of a row begins, by tag."""
        return {row.tag: row.dialect.write(row.address, b'\0\0')[1][:-2]
                for row in self.world.rows.values()
                if row.station == 1 and (row.writes or row.is_heartbeat)}

    def _meant(self, command: Packet) -> tuple[str, int]:
        """Return the row that a write goes to, and the value."""
        tag = next((tag for tag, begin in self._begins.items()
                    if command.data[:-2] == begin), '')
        return tag, int.from_bytes(command.data[-2:], 'little')

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

    def _land(self, kept: Kept) -> None:
        if not kept.is_done:
            kept.is_done = True
            self._last_news = max(self._last_news, self.world.line.now)
            kept.execute(kept.command, is_late=True)

    # What people and programs do

    def publish(self, argument: str) -> None:
        """Publish a message, which may be so many seconds old."""
        if _SPEED not in self.world.rows:
            raise Pointless
        self.world.publish(self.world.rows[_SPEED], float(argument or 0.0))

    def ask(self, argument: str) -> None:
        """Let a guest write a word, or what nobody knows."""
        world = self.world
        if not world.driver.is_online or world.line.now < self._dead_until:
            raise Pointless
        if argument == 'unknown':
            world.command(1, 0x0F, b'\x68\0\0')
            return
        address = world.plcs[1].place_of({'speed': OUTPUTS, 'beat': BEAT}[argument])
        dialect = world.rows['clock_1'].dialect  # the row of the word may be gone
        world.command(1, *dialect.write(address, world.next_of_guests.to_bytes(2, 'little')))

    def deliver_from_before(self, argument: str) -> None:
        """Let the gateway deliver what another program sent before the port was opened."""
        world = self.world
        left = world.opened + world.held_for - _LAST - world.line.now
        if left <= 0 or not world.driver.is_online or self._execute is None:
            raise Pointless
        watched = world.plcs[1]
        dialect = world.rows['clock_1'].dialect
        word, _, when = argument.partition(' ')
        value = _FROM_BEFORE[len(self._kept)]
        place = {'speed': OUTPUTS, 'beat': BEAT}[word]
        cmd, data = dialect.write(watched.place_of(place), value.to_bytes(2, 'little'))
        self._mark()
        kept = Kept(Packet(1, 77, cmd, 0, 1, data), self._execute, watched.tags.get(place, ''),
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
        """Bring back what the PLC had half a second after the start, and run again."""
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

    def unplug(self, argument: str) -> None:
        """Lose the port for so many seconds."""
        if not self.world.driver.is_online:
            raise Pointless
        self.world.lose_port()
        self._mark(float(argument))
        self._open_again(float(argument))

    def end(self, argument: str) -> None:
        """End in order, as after a signal; another process begins so many seconds later."""
        def ended() -> None:
            self.world.lose_port('the driver is stopping')
            self._judge.look()
            self._judge.over()
            self.kill(argument)

        self._wind_down(LONGEST_END, ended)

    def hand_port_over(self, argument: str) -> None:
        """Give the port to other programs for so many seconds."""
        def ended() -> None:
            self.world.lose_port('released')
            self._open_again(float(argument))

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
            self._begins = self._writes_begin()

        until = self.world.line.now + HAND_OVER
        rows = RELOADS[argument](self.world.plant.mappings())
        safe = {(row.extent, row.fallback) for row in rows}
        self._wind_down(HAND_OVER, ended, lambda row: (row.extent, row.fallback) not in safe)

    def _open_again(self, seconds: float) -> None:
        world, process = self.world, self.world.process

        def open_again() -> None:
            if world.process == process and not world.driver.is_online:
                world.driver.interlocks.end.resume()
                self._cut_off()
                world.open()
                world.opened = world.line.now

        world.at(world.line.now + seconds, open_again)

    def _wind_down(self, limit: float, then: Callable[[], None],
                   is_meant: Callable[[Mapping], bool] = lambda row: True) -> None:
        """Write all 0s and Fallbacks, wait for them, judge what the log names, and go on."""
        world, driver = self.world, self.world.driver
        if driver.interlocks.end.is_asked or world.line.now < world.away or not world.is_alive:
            raise Pointless
        world.ended = world.line.now
        driver.interlocks.end.wind_down()
        world.line.wake(driver.machine)

        def look() -> None:
            if world.driver is not driver:
                return  # it was killed
            waits = driver.interlocks.end.has_to_wait(is_open=driver.is_online, is_meant=is_meant)
            if not waits or world.line.now >= world.ended + limit:
                self._demand_named()
                then()
            else:
                world.at(max(world.away, world.line.now + _GLANCE), look)

        look()

    def _demand_named(self) -> None:
        """Demand that the end names each word that is not safe; none if nothing was wrong (5)."""
        watched, interlocks = self.world.plcs[1], self.world.driver.interlocks
        named = {text.split(' ')[0] for text in (
            *interlocks.end.unconfirmed(self.world.line.now), *interlocks.end.not_repeated())}
        is_well = self._ill_until == -math.inf
        for row in (*interlocks.fallbacks, *interlocks.heartbeats):
            tag = row.mapping.tag
            value = watched.word(str(row.mapping.address))
            is_told = tag in named and not is_well
            if value not in (0, SAFE) and not is_told and not self._is_unknowable(tag):
                raise Broken('Named', f'the end does not name {tag}, which holds {value} (5)',
                             self.world)

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
        told = {(result.mapping.tag, result.value.strip('[]')) for result in world.results}
        reasons = {
            'something is wrong': world.line.now <= self._ill_until + 2 * STEP,
            'a mode that is not seen': world.line.now <= self._mode_seen_at + 2 * STEP,
            'the port': not driver.is_online,
            'the gateway': any(not kept.is_done for kept in self._kept),
            'commands': driver.guests.waiting or any(
                is_write(job.command) for job in driver.tasks.under_way),
            'results': any((tag, str(value)) not in told
                           for tag, value in world.keys[self._forgotten:]),
            'a fallback': any(row.state is not FallbackState.STANDS or not row.is_confirmed
                              for row in driver.interlocks.fallbacks),
            'a heartbeat': any(beat.topics and not beat.is_confirmed
                               for beat in driver.interlocks.heartbeats)}
        return next((reason for reason, is_so in reasons.items() if is_so), '')

    def _is_unknowable(self, tag: str) -> bool:
        """Tell whether a gateway that nobody can know of has delivered a command from before."""
        last = next((entry for entry in reversed(self.world.executed) if entry.tag == tag), None)
        return last is not None and last.is_late and not self._is_gateway_known and (
            last.value in _FROM_BEFORE or last.driver < self._first_driver)

    def _demand_belief(self) -> None:
        """Demand that each word holds what the driver believes: a Fallback, or 0."""
        interlocks = self.world.driver.interlocks
        for row in (*interlocks.fallbacks,
                    *(beat for beat in interlocks.heartbeats if beat.topics)):
            tag = row.mapping.tag
            watched = self.world.plcs[row.mapping.station]
            value = watched.word(watched.places[tag])
            if self._is_unknowable(tag):
                continue
            if value not in (0 if tag.startswith('beat') else SAFE, OTHERS):
                raise Broken('Belief', f'{tag} is at rest for the driver, and holds {value}',
                             self.world)

    def _recover(self) -> None:
        """Demand that a message is written, and that the heartbeat counts."""
        world = self.world
        results, executed = len(world.results), len(world.executed)
        for _ in range(12):
            self._publish()
            self._wait(0.35)
        is_written = any(result.outcome is Outcome.WRITTEN for result in world.results[results:])
        counts = any(entry.tag == _BEAT and entry.value for entry in world.executed[executed:])
        if not is_written and _SPEED in world.rows:
            raise Broken('Recovery', 'no message is written', world)
        if not counts and _BEAT in world.rows:
            raise Broken('Recovery', 'the heartbeat does not count', world)


_STATUS = {'refused': 0x10, 'not': 0x02, 'sts': 0x02}

_EVENTS: dict[str, Callable[[Telling, str], None]] = {
    'message': Telling.publish, 'guest': Telling.ask, 'before': Telling.deliver_from_before,
    'overwrite': Telling.overwrite, 'silent': Telling.fall_silent,
    'program': Telling.stop_program, 'download': Telling.download,
    'still': Telling.stand_still, 'executor': Telling.hang_executor, 'kill': Telling.kill,
    'unplug': Telling.unplug, 'end': Telling.end, 'polling': Telling.hand_port_over,
    'reload': Telling.reload}
