"""The embedded agent: onboards a host with what the operating system itself states, without a model or a network.

It is one implementation of an agent among others, not part of the core: it runs as its own process
(``python -m octoform.builtin task.json``), is given the same task, writes the same output file and passes the same
contracts. It imports nothing of octoform outside this package, and nothing imports it.
"""
