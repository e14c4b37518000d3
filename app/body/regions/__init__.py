"""What a body is made of, region by region."""
