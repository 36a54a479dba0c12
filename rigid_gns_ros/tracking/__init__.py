"""From frames of poses without names to spheres with velocities."""
