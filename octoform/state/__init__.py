"""The state of a host: snapshot, journal, lock, artifacts, and how all of it survives crashes.

Light modules serve a plan with nothing to do: `layout`, `files`, `store.quick_read`, `store.journal`, `store.lock`,
`artifacts.accepted`, `artifacts.instances` and `git.head`. `model`, `store.replay`, `store.snapshot` and `store.store`
need pydantic, and `git.repository` needs git.
"""
