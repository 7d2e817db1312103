"""Which exceptions of a tool say something of its code, and which of its device."""

import pytest

from octoform.endpoint.client.check_verdict import DEFECTS


@pytest.mark.parametrize("kind", [AttributeError, KeyError, RecursionError, TypeError, ZeroDivisionError, SyntaxError])
def test_faults_of_code(kind: type[BaseException]) -> None:
    assert kind.__name__ in DEFECTS


@pytest.mark.parametrize("kind", [RuntimeError, OSError, ValueError, TimeoutError, PermissionError, Exception])
def test_what_a_device_may_be_the_reason_of(kind: type[BaseException]) -> None:
    assert kind.__name__ not in DEFECTS
