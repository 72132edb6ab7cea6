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

"""Listen to a line before anything is sent on it: another master may poll its stations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
import time

from abdf1_ros.cli.overhearing import Overhearing
from abdf1_ros.cli.plc.session import opened
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Poll
from abdf1_ros.df1.listener import LineKind, ListeningDecoder
from abdf1_ros.driver.overheard import Carried
from abdf1_ros.errors import PortLost
from abdf1_ros.ports.wake import Wake
from abdf1_ros.settings.network import Network
from abdf1_ros.sniffer.capture import Chunk, Direction

LISTENED_FOR_READS = 10.0
"""Seconds to listen for the reads of another master, to make a map of these reads."""

LISTENED = 1.0
"""Seconds to listen at each speed; masters poll a few times a second."""

# Number of polls that show a master. One poll is not enough: after DLE ENQ, one of 256 random byte
# pairs has a right BCC.
_SURE_POLLS = 2


@dataclass(frozen=True, slots=True)
class ForeignMaster:
    """A master that we heard: its speed, the stations that it polls, the check of its messages."""

    baud: int
    stations: Sequence[int]
    check: Checksum | None

    def __str__(self) -> str:
        """Return one line of text."""
        check = 'check unknown' if self.check is None else self.check.value
        stations = ', '.join(map(str, self.stations))
        return (f'another master polls {"stations" if len(self.stations) > 1 else "station"} '
                f'{stations}, {self.baud} baud, {check}')


def overhear(network: Network, bauds: Sequence[int],
             show: Callable[[str], None] = lambda text: None) -> ForeignMaster | None:
    """
    Listen at each speed; stop at a speed without a character.

    Return the first master that is heard, None for none. Sends nothing.

    Raises NoPort and PortLost.
    """
    for baud in bauds:
        show(f'listening at {baud} baud')
        characters, polls, check = _heard(replace(silent(network), baud=baud))
        if polls.total() >= _SURE_POLLS:
            return ForeignMaster(baud, sorted(polls), check)
        if not characters:
            return None
    return None


def silent(network: Network) -> Network:
    """Return the line with its port for reading only, if possible."""
    return network if network.port.startswith('rfc2217:') else replace(network, mode='Listen')


def heard_reads(network: Network, seconds: float) -> list[Carried]:
    """
    Listen for ``seconds``; return the answered reads of other nodes.

    Raises NoPort and PortLost.
    """
    overhearing = Overhearing(network)
    for at, data in _bytes_of(network, seconds):
        # Bytes of a second port are marked by their class, SecondPort.
        overhearing.hear(Chunk(at, Direction.UNKNOWN, data))
    return overhearing.carried


def _bytes_of(network: Network, seconds: float) -> Iterator[tuple[float, bytes]]:
    """Open the port for ``seconds``; yield bytes as they come, with their time (s) since then."""
    port, wake = opened(network)(), Wake()
    try:
        begun = time.monotonic()
        while (now := time.monotonic() - begun) < seconds:
            data = port.read(seconds - now, wake.descriptor)
            yield time.monotonic() - begun, data
    except OSError as error:
        raise PortLost(error.strerror or str(error)) from None
    finally:
        port.close()
        wake.close()


def _heard(network: Network) -> tuple[int, Counter[int], Checksum | None]:
    """Return the number of characters, the polls with a good check, and the check of messages."""
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    characters, polls = 0, Counter[int]()
    for _, data in _bytes_of(network, LISTENED):
        characters += len(data)
        decoder.feed(data)
        while (symbol := decoder.next_symbol()) is not None:
            if isinstance(symbol, Poll) and symbol.valid:
                polls[symbol.station] += 1
    return characters, polls, kind.checksum
