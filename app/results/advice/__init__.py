"""What people are told of a solution beside its numbers: that it locks, and what to try next."""
