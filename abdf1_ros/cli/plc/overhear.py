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
from abdf1_ros.df1.frames import Frame, Poll
from abdf1_ros.df1.listener import LineKind, ListeningDecoder
from abdf1_ros.diagnosis.traces import SURE
from abdf1_ros.driver.overheard import Carried
from abdf1_ros.errors import PortLost
from abdf1_ros.ports.wake import Wake
from abdf1_ros.settings.network import Network
from abdf1_ros.sniffer.capture import Chunk, Direction

LISTENED_FOR_READS = 10.0
"""Seconds to listen for the reads of another master, to make a map of these reads."""

LISTENED = 1.0
"""Seconds to listen at each speed; most masters poll a few times a second."""

LISTENED_ON = 6.0
"""Seconds to listen at a speed with one poll or message: more may come from a slow master."""


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
    Listen at each speed; only at the first speed, if no character comes.

    Return the first master that is heard, None for none. Sends nothing.

    Raises NoPort and PortLost.
    """
    has_traffic = False
    for baud in bauds:
        show(f'listening at {baud} baud')
        characters, named, check = _heard(replace(silent(network), baud=baud))
        if named.total() >= SURE:
            return ForeignMaster(baud, sorted(named), check)
        has_traffic |= characters > 0
        if not has_traffic:
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
    for at, data in _bytes_of(network, lambda: seconds):
        # Bytes of a second port are marked by their class, SecondPort.
        overhearing.hear(Chunk(at, Direction.UNKNOWN, data))
    return overhearing.carried


def _bytes_of(network: Network, seconds: Callable[[], float]) -> Iterator[tuple[float, bytes]]:
    """Open the port for ``seconds``; yield bytes as they come, with their time (s) since then."""
    port, wake = opened(network)(), Wake()
    try:
        begun = time.monotonic()
        while (left := begun + seconds() - time.monotonic()) > 0:
            data = port.read(left, wake.descriptor)
            yield time.monotonic() - begun, data
    except OSError as error:
        raise PortLost(error.strerror or str(error)) from None
    finally:
        port.close()
        wake.close()


def _heard(network: Network) -> tuple[int, Counter[int], Checksum | None]:
    """
    Return what a master has sent, as far as its check is good.

    The number of characters, how often a poll or message names each station, and the check.
    """
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    characters, named = 0, Counter[int]()
    for _, data in _bytes_of(
            network, lambda: LISTENED_ON if 0 < named.total() < SURE else LISTENED):
        characters += len(data)
        decoder.feed(data)
        while (symbol := decoder.next_symbol()) is not None:
            if isinstance(symbol, Poll) and symbol.valid or (
                    isinstance(symbol, Frame) and symbol.fault is None):
                # Only a master names a station: slaves, and both ends of full duplex, do not.
                named.update([] if symbol.station is None else [symbol.station])
    return characters, named, kind.checksum
