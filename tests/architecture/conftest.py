"""The trees of the package's sources, of hundreds of megabytes, are kept for these tests and for no others."""

from collections.abc import Iterator

import pytest
from architecture import parsed


@pytest.fixture(scope="package", autouse=True)
def trees_go_with_the_last_test() -> Iterator[None]:
    yield
    parsed.forget()
