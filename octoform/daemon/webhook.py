"""One POST of JSON, in a process of its own that is ended when it takes too long.

Run as ``python -m octoform.daemon.webhook`` with ``{url, body, seconds}`` on standard input; status 0 when
the other side answered with 2xx. What went wrong is printed to standard error without the URL or any part of it,
since anyone who has it may write there.
"""

import json
import sys
from http.client import HTTPException, HTTPMessage
from typing import IO
from urllib.error import HTTPError, URLError
from urllib.request import HTTPRedirectHandler, Request, build_opener

from octoform.base.files import parse


class _NoRedirects(HTTPRedirectHandler):
    """Only the manifest states where a message goes."""

    def redirect_request(
        self, req: Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage, newurl: str
    ) -> None:
        """No other request: the answer stays an error."""


def post(url: str, body: object, seconds: float) -> str | None:
    """Post a JSON body; None when it was taken, else why not."""
    try:
        request = Request(
            url,
            json.dumps(body).encode(),
            {"Content-Type": "application/json", "User-Agent": "octoform"},
            method="POST",
        )
        if request.type not in ("http", "https"):
            return "it is no URL of http or https"
        with build_opener(_NoRedirects).open(request, timeout=seconds):
            return None
    except HTTPError as problem:
        problem.close()
        return f"it answered with {problem.code}"
    except URLError as problem:
        return _reason(problem.reason)
    except (OSError, HTTPException, ValueError) as problem:
        return _reason(problem)


def _reason(problem: object) -> str:
    """The kind of a problem: the texts of these exceptions may repeat the URL."""
    found = problem.strerror if isinstance(problem, OSError) and problem.strerror else None
    return f"it cannot be reached ({type(problem).__name__}{f': {found}' if found else ''})"


def main() -> int:
    """Post what standard input has."""
    asked = parse(sys.stdin.buffer.read())
    why = post(asked["url"], asked["body"], asked["seconds"])
    if why is not None:
        print(why, file=sys.stderr)
    return 0 if why is None else 1


if __name__ == "__main__":
    sys.exit(main())
