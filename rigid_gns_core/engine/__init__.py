"""Prediction without torch: the contact model compiled by Numba, the thesis' GNS in NumPy."""
