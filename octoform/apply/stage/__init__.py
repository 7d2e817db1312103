"""One stage: who is asked, an attempt in its own folder, the gate, and what is kept of the accepted value."""
