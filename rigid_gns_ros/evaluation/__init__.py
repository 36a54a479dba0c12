"""How recorded predictions are compared with what was tracked."""
