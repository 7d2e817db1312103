"""The process behind every client of a host: check, load, own, serve, until it is asked to stop."""

import asyncio
import logging
import os
import sys
from pathlib import Path

from octoform.base import marks
from octoform.base.shortage import TEXT, limits, printed

from .addresses import NoAddressError
from .audit import AuditFailed
from .descriptor import RefusedError, read, untouched
from .folders import NotOursError, private
from .owner import MARK, Owner
from .policy import PolicyInvalid
from .saying import Said, say

REFUSED = 78
"""Exit status for a configuration that may not be served (EX_CONFIG)."""
FAILED = 70
"""Exit status when it served and could not go on (EX_SOFTWARE): whoever supervises it starts it again."""
TAKEN = 75
"""Exit status when another process owns the endpoint (EX_TEMPFAIL)."""


def main(folder: Path) -> int:
    """Serve the endpoint in ``folder``; the exit status. Does not return once it has served."""
    logger = logging.getLogger("octoform")
    logger.addHandler(Said())
    try:
        untouched(folder)
        descriptor = read(folder)
        for kept in (descriptor.run, descriptor.log):
            private(kept)
        owner = Owner.take(descriptor.run)
        if owner is None:
            say("another process serves this endpoint already")
            return TAKEN
        os.environ.update(descriptor.environment)
        marks.put_on(os.environ.setdefault(MARK, marks.new(16)))  # who started it by hand has given none
        from .endpoint import (
            DoorFailedError,
            Endpoint,
        )  # only now: FastMCP reads its settings from the environment as it is loaded
        from .loading import load

        endpoint = Endpoint(descriptor, owner, load(descriptor))
    except (RefusedError, NotOursError, PolicyInvalid, AuditFailed) as problem:
        return _refuse(problem)
    status = 0
    try:
        asyncio.run(endpoint.serve())
    except (NoAddressError, AuditFailed) as problem:
        status = _refuse(problem)
    except DoorFailedError as problem:
        say(f"it ends: {problem}")
        status = FAILED
    except RuntimeError as problem:
        if not printed(str(problem)):
            logger.exception("it ends")
        else:
            say(f"it ends: {TEXT} ({limits()})")
        status = FAILED
    except Exception:  # whatever it is: threads of tools must not keep alive what serves nobody
        logger.exception("it ends")
        status = FAILED
    owner.release()
    sys.stdout.flush()
    sys.stderr.flush()
    # A tool that never returns has a thread that never ends, and the interpreter would wait for it.
    os._exit(status)


def _refuse(problem: Exception) -> int:
    say(f"refused: {problem}")
    return REFUSED
