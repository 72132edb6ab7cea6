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
Tell what rclpy refuses at the start, and what may be meant.

rclpy names a wrong argument in the words of its parser. We add the likely cause.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
import re

from abdf1_ros.text import alike, printable
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation

EXIT_CONFIGURATION = 2
EXIT_FAULT = 1

# Errors of rclpy for bad names, parameters and arguments, or if ROS does not start. All other
# errors are bugs.
REFUSALS = (NameValidationException, ParameterException, rclpy_implementation.RCLError,
            rclpy_implementation.UnknownROSArgsError)

# How rclpy's errors about the log directory begin.
_LOG_FAILURES = re.compile('.*Failed to create log directory|Failed opening file')

# Words in rclpy's errors about bad arguments.
_BAD_ARGUMENTS = re.compile("Couldn't parse|should not exceed|invalid node namespace")

# Hints to put before an error: a pattern of the error, and the hint.
_ADVICE = (
    (r"^\['(?:__|~|/)[^']*:=", '-r is missing before '),
    (r"^\['[^']*:=", '-p is missing before '),
    (r"parameter override rule: '-p [\w.]+:='",
     "a parameter has no value; for an empty text write NAME:=''; "),
    (r"parameter override rule: '-p \w+=", 'a parameter is NAME:=VALUE, with a colon; '),
    (r"override rule: '-p [\w.]+:=\[", 'put quotes around a text with [ or :; '),
    (r"^\['--?[hv]", 'write this before --ros-args: '),
    ('Cannot have a value before ros__parameters', 'a file of parameters begins with the lines '
     '"/**:" and "  ros__parameters:"; '),
    (r'log level:', 'a level is debug, info, warn, error or fatal, for one logger NAME:=LEVEL; '),
    (r'remap rule: .*__ns:=/|invalid node namespace: (?!.*should not exceed)',
     'a namespace has names of letters, digits and underscores, each after one "/", and no "/" at '
     'its end; '),
    (r'remap rule: .*__ns:=', 'a namespace begins with "/"; '),
    (r'remap rule: .*__(?:node|name):=', 'a node name has letters, digits and underscores; '))


# The long options of rcl after --ros-args, and ours before it.
_ROS_OPTIONS = (
    '--param', '--remap', '--params-file', '--log-level', '--log-config-file', '--log-file-name',
    '--enclave', *(f'--{switch}-{what}' for switch in ('enable', 'disable') for what in (
        'rosout-logs', 'stdout-logs', 'external-lib-logs')))
_OWN_OPTIONS = '--help', '--version', '--ros-args'


def unknown_argument(unknown: Sequence[str]) -> str:
    """Return a text for the first of the words before --ros-args that no command knows."""
    own, after = _nearest(unknown[0], _OWN_OPTIONS), _nearest(unknown[0], _ROS_OPTIONS)
    meant = own or (f'--ros-args {after}' if after else '')
    hint = f'did you mean {meant}?' if meant else 'write parameters after --ros-args'
    return f'{printable(" ".join(unknown))}: unknown argument; {hint}'


def _nearest(word: str, options: Sequence[str]) -> str:
    return next(iter(alike(word, options)), '') if word.startswith('--') else ''


def refusal(error: Exception) -> tuple[int, str]:
    """
    Return the exit status and a text for an error of rclpy.

    Wrong arguments stay wrong. Other reasons may pass: while the machine starts, a disk or a
    network may not be ready. Then a supervisor should try again.
    """
    text = printable(' '.join(str(error).split()))
    if _LOG_FAILURES.match(text):
        return EXIT_FAULT, f'{text}; set ROS_LOG_DIR to a directory that this user may write to'
    may_pass = isinstance(error, RuntimeError) and \
        not isinstance(error, rclpy_implementation.UnknownROSArgsError)
    if may_pass and not _BAD_ARGUMENTS.search(text):
        hint = '; ROS_SECURITY_ENABLE is true: set ROS_SECURITY_KEYSTORE, too' \
            if text.endswith('error not set') and wants_security() else ''
        return EXIT_FAULT, f'ROS does not start: {text}{hint}'
    advice = next((advice for pattern, advice in _ADVICE if re.search(pattern, text)), '')
    meant = _nearest(text.removeprefix("['").partition("'")[0], _ROS_OPTIONS)
    hint = f'; did you mean {meant}?' if meant else ''
    return EXIT_CONFIGURATION, f'bad arguments: {advice}{text}{hint}'


def wants_security() -> bool:
    """Return True if ROS is to start with security."""
    return os.environ.get('ROS_SECURITY_ENABLE') == 'true'
