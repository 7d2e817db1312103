"""A small agent of octoform's own: a model, a shell and a few file tools, in a loop.

It needs no program but the Python package litellm, runs as a process of its own below the usual containment, and
shows what it does as JSON lines on standard output (see `reporting`). What it states is believed no more than what any
other agent reports.
"""
