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

"""The tiny plants of the explorer: two or three kinds of rows in each, and each pair in one."""

from __future__ import annotations

from abdf1_ros.settings.heartbeats import Fallback, While
from explorer.tiny import KEPT, LATE, LOST, OK, Plant, REFUSED, SLOW, UNANSWERED
from support.mappings import make_mapping

_SPEED = make_mapping('N7:0', 'Write', tag='speed', fallback=Fallback((7,), 1000))
_BEAT = make_mapping('N7:1', 'Heartbeat', tag='beat', period=500)
_FED = make_mapping('N7:1', 'Heartbeat', tag='beat', period=500,
                    condition=While(('speed',), 1000))
_AGAIN = make_mapping('N7:2', 'Write', tag='again', write_again=2000,
                      fallback=Fallback((7,), 2000))
_REPEATED = make_mapping('N7:5', 'Write', tag='repeated', write_again=3000)
_RECIPE = make_mapping('N7:3', 'ReadWrite', tag='recipe', period=500)
_SERVED = make_mapping('N9:0', 'Serve', tag='served', fallback=Fallback((7,), 1000))
_SINGLE = make_mapping('N7:0', 'Write', tag='speed', fallback=Fallback((7,), 1000),
                       single_publisher=True)
_ELSEWHERE = make_mapping('N7:4', 'Write', tag='other', station=2, fallback=Fallback((7,), 1000))

_FAULTS = OK, LOST, UNANSWERED, REFUSED
_GATEWAY = OK, UNANSWERED, *KEPT

PLANTS: dict[str, Plant] = {
    'cell': Plant((_SPEED, _FED), ('message speed', 'old speed', 'RUN', 'end'), _FAULTS),
    'slow': Plant((_SPEED, _BEAT), ('message speed', 'guest speed', 'guest beat', 'reload'),
                  (OK, SLOW, LATE)),
    'silent': Plant((_SPEED, _FED), ('message speed', 'silent', 'answers', 'end'),
                    (OK, UNANSWERED), most_events=3),
    'gateway': Plant((_SPEED, _BEAT), ('message speed', 'end', 'reload', 'reopen'), _GATEWAY,
                     has_gateway=True),
    'direct': Plant((_SPEED, _FED), ('message speed', 'reload', 'end'), (OK, UNANSWERED, *KEPT)),
    'guests': Plant((_SPEED, _FED), ('message speed', 'guest speed', 'guest beat', 'silent',
                                     'answers'), (OK, *KEPT), has_gateway=True),
    'again': Plant((_AGAIN, _BEAT), ('same again', 'message again', 'guest again', 'RUN'),
                   (OK, LOST, UNANSWERED), is_read=True),
    'repeated': Plant((_REPEATED, _SPEED), ('same repeated', 'guest repeated', 'RUN', 'silent',
                                            'answers'), (OK, UNANSWERED), is_read=True, steps=5,
                      most_events=3),
    'recipe': Plant((_RECIPE, _AGAIN), ('message recipe', 'same again', 'silent', 'answers'),
                    (OK, UNANSWERED, REFUSED), is_read=True, has_gateway=True, is_refreshed=True),
    'served': Plant((_SERVED, _SPEED), ('message served', 'message speed', 'end', 'reload'),
                    _FAULTS),
    'server': Plant((_SPEED, _RECIPE), ('message speed', 'message recipe', 'guest speed',
                                        'reopen'), (OK, LOST, UNANSWERED), may_store=True),
    'single': Plant((_SINGLE, _FED), ('message speed', 'crowd', 'hung', 'end'),
                    (OK, UNANSWERED, SLOW)),
    'two': Plant((_SPEED, _ELSEWHERE, _BEAT), ('message speed', 'message other', 'silent',
                                               'answers', 'end'), (OK, LOST)),
}
"""Depth and budgets are such that each is complete within seconds."""
