"""Asking a model from Python, through the library litellm: for the small agent and for the bare completion.

The library costs seconds and 190 MB to import, so it is only ever imported in a process of its own that asks.
"""
