"""What keeps Newton's method on its way down: balance, merit, line search, and ways off saddle points."""
