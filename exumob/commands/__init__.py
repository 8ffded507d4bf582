"""The commands of `exumob`, a file each; `exumob/__main__.py` registers them."""
