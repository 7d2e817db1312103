"""The daemon's senses: what wakes it, and what it then looks at. Light, and never a poll where the system sends events.

`event_queue` waits for all of them at once; each ear listens to one thing. What is heard is only ever a reason to look:
nothing is concluded from an event itself.
"""
