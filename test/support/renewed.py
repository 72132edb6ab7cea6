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

"""What the tests of a module share, and made anew after a test that has failed."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, ExitStack
from typing import Generic, TypeVar

import pytest

_Shared = TypeVar('_Shared')


class Renewed(Generic[_Shared]):
    """Lends one thing to test after test, so that one failure is one, and not a row of them."""

    def __init__(self, make: Callable[[], AbstractContextManager[_Shared]]) -> None:
        self._make = make
        self._stack = ExitStack()
        self._lent: list[_Shared] = []  # what there is now: one or nothing

    @contextmanager
    def lent(self, request: pytest.FixtureRequest) -> Iterator[_Shared]:
        """Lend it to the test of ``request``."""
        failed = request.session.testsfailed
        if not self._lent:
            self._lent.append(self._stack.enter_context(self._make()))
        try:
            yield self._lent[0]
        except BaseException:
            failed -= 1
            raise
        finally:
            if request.session.testsfailed > failed:
                self._lent.clear()
                try:
                    self._stack.close()
                except AssertionError as error:  # its failure has been told
                    print(error)

    def close(self) -> None:
        """End it, after the last test."""
        self._stack.close()
