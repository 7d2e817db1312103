"""Apply: under the lock, with the person's word, and with what is told at the end."""
