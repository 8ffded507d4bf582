"""One run: the macro steps, its result, its checkpoint, its figures."""
