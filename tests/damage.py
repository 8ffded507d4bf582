"""Damage to files, always the same for a seed."""

import numpy as np


def damage(file, seed, ends):
    """Cut a file off, turn a bit over or leave a piece out, by the seed: at four places first, then anywhere.

    ``ends`` are the places of seeds 0 to 11, from the file's beginning or, if negative, from its end.
    """
    data, rng = bytearray(file.read_bytes()), np.random.default_rng(seed)
    place = ends[seed // 3] % len(data) if seed < 12 else int(rng.integers(len(data)))
    if seed % 3 == 0:
        del data[place:]
    elif seed % 3 == 1:
        data[place] ^= 1 << int(rng.integers(8))
    else:
        del data[place : place + int(rng.integers(1, 100))]
    file.write_bytes(data)
