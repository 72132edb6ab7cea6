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
The conformance kit: it plays one end of a line and checks the target at the far end.

``codec`` makes and reads bytes, ``wire`` sends and receives them, ``case`` defines and runs a
case, ``ends`` are the parts that we play. ``slave``, ``master``, ``peer``, ``client`` and
``radio`` hold the cases, named after the target. ``data``, ``duplicates``, ``damage`` and
``asking`` hold cases for several targets. ``cases`` has all of them. ``report`` writes the
results.

The kit has its own codec, written from the manual and not from ``df1``: with the same code at both
ends a wrong rule would pass. Pages are cited as in ``df1``.
"""
