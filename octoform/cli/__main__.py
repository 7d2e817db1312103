"""``python -m octoform.cli``: the command line by an absolute path, as configurations of clients name it."""

import sys

from octoform.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
