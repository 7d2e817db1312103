"""Options of all tests."""

import os

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--update`` rewrites the expected files of golden cases instead of comparing with them."""
    parser.addoption("--update", action="store_true", help="rewrite the expected files of golden cases")


def pytest_configure(config: pytest.Config) -> None:
    """A machine that only checks must not write what it should compare with."""
    if config.getoption("--update") and os.environ.get("CI"):
        raise pytest.UsageError("--update is for people: it is refused where CI is set")


@pytest.fixture
def update(request: pytest.FixtureRequest) -> bool:
    """True when expected files are to be rewritten."""
    return bool(request.config.getoption("--update"))
