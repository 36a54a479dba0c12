"""Moving pictures of spheres, drawn on the CPU; see docs/report.md."""
