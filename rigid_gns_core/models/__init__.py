"""Networks and steppers of the learned simulators, most of it in PyTorch."""
