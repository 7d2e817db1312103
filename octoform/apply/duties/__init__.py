"""The agents of the daemon: what they are given, WATCH and HEAL."""
