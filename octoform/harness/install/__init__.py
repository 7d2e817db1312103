"""The programs of the harnesses: where they are, and their installation in a pinned version."""
