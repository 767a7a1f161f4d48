"""A control law of my own."""
