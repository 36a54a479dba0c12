"""The files of a bag."""
