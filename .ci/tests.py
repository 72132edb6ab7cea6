"""
Run ``make test``; what fails beside others gets a second run, alone, but never in silence.

At most three tests get one, and none that says that something does not end. Both outcomes are told
here and at the end of ``.ci/run``, and put into ``.ci/second_tries.csv``: each line of it is a
fault that somebody has to find, of the test or of the package.
"""

from __future__ import annotations

from datetime import date
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
from xml.etree import ElementTree

_ROOT = Path(__file__).resolve().parent.parent
_CACHE = _ROOT / '.pytest_cache'
_MOST = 3
_NEVER = ('does not end', 'Timeout (>', 'Timeout >', 'crashed')


def main() -> int:
    """Run the tests; return the exit status."""
    shutil.rmtree(_CACHE, ignore_errors=True)
    report = _CACHE / 'tests.xml'
    if not _make('test', f'PYTEST_ARGS=--junitxml={report.relative_to(_ROOT)}'):
        return 0
    failed = _last_failed()
    if not 0 < len(failed) <= _MOST or any(text in _told(report) for text in _NEVER):
        print(f'{len(failed)} tests failed, or something did not end: no second try',
              file=sys.stderr)
        return 1
    status = _make('test', 'TEST_WORKERS=0', 'PYTEST_ARGS=--last-failed')
    still = _last_failed() if status else set()
    commit = subprocess.run(['git', 'rev-parse', '--short', 'HEAD'], cwd=_ROOT, check=False,
                            capture_output=True, text=True).stdout.strip()
    for test in sorted(failed):
        second = 'failed' if test in still else 'passed'
        _note(f'second try: {test}: first failed, then {second}; see .ci/second_tries.csv')
        with (_ROOT / '.ci' / 'second_tries.csv').open('a', encoding='utf-8') as file:
            file.write(f'{date.today()},{commit},"{test}",failed,{second}\n')
    return int(status != 0)


def _make(*arguments: str) -> int:
    print('== make', *arguments, flush=True)
    return subprocess.run(['make', '--no-print-directory', *arguments], cwd=_ROOT,
                          check=False).returncode


def _last_failed() -> set[str]:
    file = _CACHE / 'v' / 'cache' / 'lastfailed'
    return set(json.loads(file.read_text(encoding='utf-8'))) if file.exists() else set()


def _told(report: Path) -> str:
    """Return the texts of all failures."""
    if not report.exists():
        return 'crashed'
    return '\n'.join(
        f'{entry.get("message")} {entry.text}' for entry in ElementTree.parse(report).iter()
        if entry.tag in ('failure', 'error'))


def _note(text: str) -> None:
    print(text, file=sys.stderr)
    if 'NOTES' in os.environ:
        with open(os.environ['NOTES'], 'a', encoding='utf-8') as notes:
            notes.write(f'{text}\n')


if __name__ == '__main__':
    sys.exit(main())
