"""Many cases: their table, and ways to share them."""
