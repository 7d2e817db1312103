"""The server process: its descriptor, its lock, its log, its local sockets."""
