"""From bags to data sets."""
