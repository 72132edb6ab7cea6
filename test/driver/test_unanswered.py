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

"""Equal commands that a station leaves unanswered wait longer each time."""

from __future__ import annotations

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.unanswered import UnansweredCommands

COMMAND = Packet(1, 9, 0x0F, 0, 1, b'\xA2\2\7\x89\0\0')


def pauses(commands: UnansweredCommands, tries: int, took: float) -> list[float]:
    """Return how long an equal command has to wait after each try."""
    now, found = 0.0, list[float]()
    for number in range(tries):
        command = COMMAND._replace(src=number, tns=number)  # of any guest
        commands.tried(1, command, took, now, is_answered=False)
        waited = 0.0
        while not commands.may_be_sent(1, command, now + waited):
            waited += 0.5
        found.append(waited)
        now += waited
    return found


def test_pauses_grow_with_the_line_time_up_to_a_minute() -> None:
    assert pauses(UnansweredCommands(), 7, 0.5) == [0.0, 4.0, 8.0, 16.0, 32.0, 32.0, 32.0]
    assert pauses(UnansweredCommands(), 7, 2.0) == [0.0, 16.0, 32.0, 60.0, 60.0, 60.0, 60.0]


def in_vain(commands: UnansweredCommands, command: Packet, tries: int = 2) -> None:
    """Try a command at 0 s; after two tries its pause is 8 s."""
    for _ in range(tries):
        commands.tried(1, command, 1.0, 0.0, is_answered=False)


def test_only_equal_commands_to_the_same_station_wait() -> None:
    commands = UnansweredCommands()
    in_vain(commands, COMMAND)
    others = COMMAND._replace(data=b'\xA2\2\7\x89\0\1'), COMMAND._replace(cmd=6)
    assert not commands.may_be_sent(1, COMMAND, 7.9)
    assert all(commands.may_be_sent(1, other, 7.9) for other in others)
    assert commands.may_be_sent(2, COMMAND, 7.9) and commands.may_be_sent(1, COMMAND, 8.0)


def test_an_answer_ends_the_pauses() -> None:
    commands = UnansweredCommands()
    in_vain(commands, COMMAND, 4)
    commands.tried(1, COMMAND, 1.0, 0.0, is_answered=True)
    assert commands.may_be_sent(1, COMMAND, 0.0)
    assert pauses(commands, 2, 1.0) == [0.0, 8.0]


def test_only_the_last_64_commands_are_remembered() -> None:
    commands = UnansweredCommands()
    in_vain(commands, COMMAND)
    for number in range(64):
        assert not commands.may_be_sent(1, COMMAND, 7.9)
        in_vain(commands, COMMAND._replace(data=bytes([number])))
    assert commands.may_be_sent(1, COMMAND, 7.9)
