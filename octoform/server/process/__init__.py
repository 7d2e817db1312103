"""What the process is: its descriptor, its lock, its log, its local sockets."""
