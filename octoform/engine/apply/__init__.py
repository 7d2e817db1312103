"""Apply: under the lock, with the person's word, and with what is reported at the end."""
