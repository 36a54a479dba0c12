"""What the simulator node consists of."""
