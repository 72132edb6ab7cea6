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

"""Who we are: the Identity object, and the answers to the questions about it."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address, IPv4Address

from abdf1_ros.cip.encapsulation import EipItem, encode_items
from abdf1_ros.cip.requests import CipRefusal, CipRequest, CipService, CipStatus, response
from abdf1_ros.pccc.fields import word

# ODVA assigns vendor numbers, and this package has none; 0 is reserved. So programs with a list of
# devices, such as RSLinx, show an unrecognized device.
_VENDOR = 0
_COMMUNICATIONS_ADAPTER = 0x0C  # device type
_PRODUCT_CODE = 1
_REVISION = bytes((1, 1))
_STATUS = 0x0030  # no I/O connections are established
_OPERATIONAL = 3

_TCP = 0x20  # capability flag
_SERVICE_NAME = b'Communications'.ljust(16, b'\0')
_INTERNET = 2  # address family


@dataclass(frozen=True, slots=True)
class CipIdentity:
    """The identity of a place; ``serial_number`` is its own, and ``name`` has 32 bytes at most."""

    serial_number: int
    name: bytes = b'abdf1_ros'

    @property
    def _attributes(self) -> tuple[bytes, ...]:
        """Return the attributes 1 to 7: vendor to name."""
        return (word(_VENDOR), word(_COMMUNICATIONS_ADAPTER), word(_PRODUCT_CODE), _REVISION,
                word(_STATUS), self.serial_number.to_bytes(4, 'little'),
                bytes((len(self.name),)) + self.name)

    def serve(self, request: CipRequest) -> bytes:
        """Return the response to a request; CipRefusal if it asks for what we do not have."""
        if request.service == CipService.GET_ATTRIBUTES_ALL and len(request.path) == 2:
            return response(request.service, b''.join(self._attributes))
        if request.service != CipService.GET_ATTRIBUTE_SINGLE:
            raise CipRefusal(CipStatus.NO_SERVICE)
        attributes = (*self._attributes, bytes((_OPERATIONAL,)))
        number = request.path[2] if len(request.path) > 2 else 0
        if not 0 < number <= len(attributes):
            raise CipRefusal(CipStatus.NO_ATTRIBUTE)
        return response(request.service, attributes[number - 1])

    def listed(self, host: str, port: int) -> bytes:
        """Return the data of the reply to ListIdentity: who is at this address."""
        address = ip_address(host)
        packed = address.packed if isinstance(address, IPv4Address) else bytes(4)
        socket_address = _INTERNET.to_bytes(2, 'big') + port.to_bytes(2, 'big') + packed + bytes(8)
        return encode_items((EipItem.IDENTITY, word(1) + socket_address + b''.join(
            self._attributes) + bytes((_OPERATIONAL,))))


def services() -> bytes:
    """Return the data of the reply to ListServices: CIP over TCP, no UDP."""
    return encode_items((EipItem.SERVICES, word(1) + word(_TCP) + _SERVICE_NAME))
