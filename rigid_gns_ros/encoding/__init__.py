"""Messages as bytes, and the definitions that a bag carries."""
