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
The conformance kit: one end of a line, played by script against whatever stands at the other.

``codec`` makes and reads bytes, ``wire`` sends and hears them, ``case`` says what a case is and
runs it, ``ends`` are the parts that we play. ``slave``, ``master``, ``peer`` and ``client`` hold
the cases, named after what stands at the other end; ``data`` and ``asking`` hold those of
the commands, which both disciplines carry. ``report`` tells.

The codec is a second one on purpose, written from the manual and not from ``df1``: a rule that
both ends of our own link broke alike would pass otherwise. Pages are cited as in ``df1``.
"""
