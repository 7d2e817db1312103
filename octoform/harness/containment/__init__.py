"""A process tree that cannot get out: supervisor, sandbox, and the environment an agent is given."""
