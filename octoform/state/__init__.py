"""What is known of a host: snapshot, journal, lock, artifacts, and how all of it survives crashes.

Light modules (`layout`, `files`, `peek`, `journal`, `artifacts`, `instances`, `head`, `lock`) serve a plan with nothing
to do; `model`, `fold`, `reader` and `store` need pydantic, `history` needs git.
"""
