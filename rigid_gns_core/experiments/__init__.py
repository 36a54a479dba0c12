"""The thesis' experiments (section 4), one command each; docs/thesis.md has what came out."""
