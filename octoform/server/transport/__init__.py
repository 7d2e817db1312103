"""Where clients come in: HTTP and a Unix socket, and who is let in."""
