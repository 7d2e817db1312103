"""Git: the revision that inputs are at, and one commit of what an apply changed; one way in which it is called."""
