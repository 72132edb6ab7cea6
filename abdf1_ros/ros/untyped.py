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

"""Names for what rclpy and the generated messages leave without types."""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias, TypedDict

RosMessage: TypeAlias = Any
"""A message, or the request or response of a service: an object of a generated class."""

RosType: TypeAlias = type[Any]
"""The class of a message or a service."""

RosEntity: TypeAlias = Any
"""A service, subscription or timer, as rclpy gives it to its executor."""


class MessageInfo(TypedDict):
    """The times (ns) and the number of a received message; 0 or None if they are not known."""

    source_timestamp: int
    received_timestamp: int
    publication_sequence_number: int | None


class RosPublisher(Protocol):
    """A publisher."""

    def publish(self, message: RosMessage, /) -> None:
        """Publish a message."""
