"""A body under load: spaces, what holds it, Π as terms, and its states."""
