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

"""Many cases of plain data in one test, and searches that leave nothing out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
import functools
import inspect
import itertools
import os
from pathlib import Path
from typing import Any, TypeVar

from _pytest.mark import ParameterSet
from hypothesis import strategies as st
import pytest

_Item = TypeVar('_Item')

ANY_CHARACTER = st.characters(exclude_categories=())
"""Without a class left out hypothesis needs no table of all characters, which takes it seconds."""


def for_all(names: str | Sequence[str], items: Iterable[Any],
            ) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """
    Call a test with each of ``items``; each case that fails is named.

    As ``parametrize``, for cases that take no time: a test for each would cost pytest many times
    what the test itself does.
    """
    names = (names,) if isinstance(names, str) else names
    cases = [dict(zip(names, (item,) if len(names) == 1 else item, strict=True)) for item in items]
    assert cases

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def run(**arguments: Any) -> None:
            failures = []
            for case in cases:
                try:
                    test(**arguments, **case)
                except (Exception, pytest.fail.Exception) as error:
                    error.add_note(f'case: {_shown(case)}')
                    failures.append(error)
            if len(failures) > 1:
                raise BaseExceptionGroup(f'{len(failures)} of {len(cases)} cases', failures)
            if failures:
                raise failures[0]

        signature = inspect.signature(test)
        run.__signature__ = signature.replace(parameters=[  # type: ignore[attr-defined]
            parameter for name, parameter in signature.parameters.items() if name not in names])
        return run

    return decorate


def long_unless(is_quick: Callable[..., bool], cases: Iterable[tuple[Any, ...]],
                ) -> list[ParameterSet]:
    """Return cases for ``parametrize``; "make test" leaves out those that are not quick."""
    return [pytest.param(*case, marks=() if is_quick(*case) else pytest.mark.long)
            for case in cases]


def compare_stored(path: Path, text: str) -> None:
    """Compare a text with a stored one; with UPDATE_STORED in the environment, store it before."""
    if 'UPDATE_STORED' in os.environ:
        path.write_text(text, 'utf-8')
    assert text == path.read_text('utf-8')


def _shown(case: dict[str, Any]) -> str:
    return ', '.join(f'{name} = {getattr(value, "name", None) or repr(value)}'
                     for name, value in case.items())


def groupings(items: Sequence[_Item]) -> Iterator[list[list[_Item]]]:
    """Yield every way to put ``items``, all different, into groups."""
    if not items:
        yield []
        return
    head, *rest = items
    for size in range(len(rest) + 1):
        for others in itertools.combinations(rest, size):
            for groups in groupings([item for item in rest if item not in others]):
                yield [[head, *others], *groups]
