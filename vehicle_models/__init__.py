"""Vehicle files, made to be edited: one function that returns a `Vehicle`, one value a line."""
