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
The reads and writes of one line, and their results, without a clock, thread, port or ROS.

Begin with ``driver``: its docstring says where each fact lives. ``agenda`` alone decides which job
has the line next. The queues yield jobs (``job_tasks``):

- ``kernel``: what may be written, by messages and by the bridge itself; ``writes`` sends it.
- ``checks``: questions to a station.
- ``reads``: the planned reads.
- ``guests``: commands of other programs.

The other modules are

- ``served``: the words of our own table, which PLCs read and write.
- ``requests``: single requests without a map.

No function here waits or reads a clock: its caller gives it the time (s). Other threads hand over
items through an ``inbox`` only.
"""
