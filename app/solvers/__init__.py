"""From a state to one in balance."""
