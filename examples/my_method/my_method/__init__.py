"""A guidance method of my own."""
