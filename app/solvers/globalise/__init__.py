"""What keeps Newton's method on its way down."""
