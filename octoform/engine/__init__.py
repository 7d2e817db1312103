"""The engine: compile, plan, apply, destroy. The composition root; the work is done in the layers below."""
