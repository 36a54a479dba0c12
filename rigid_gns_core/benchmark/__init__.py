"""Speed against error: all peers side by side, in one process and one run."""
