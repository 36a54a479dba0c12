"""From tracked spheres to predictions that are due. No ROS in here."""
