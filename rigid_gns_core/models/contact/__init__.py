"""The contact model in PyTorch: what is trained, and the reference that the engine is held to.

Candidates, islands, guard and sleep are written here apart from `engine`, on other libraries (a
k-d tree, sparse graphs), so that `tests/core/test_engine.py` compares two programs, not one with
itself. What changes in one changes in the other.
"""
