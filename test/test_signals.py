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

"""The end of a process that a signal asks for."""

from abdf1_ros.signals import EndRequest


def test_second_signal_does_not_begin_the_end_again() -> None:
    begun: list[float] = []
    end = EndRequest((), lambda: begun.append(end.when))
    for _ in range(2):
        end.set()
    assert begun == [end.when]
    assert end.is_set()
