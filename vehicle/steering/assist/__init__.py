"""Functions of the assist in addition to boost and motor damping, one file each."""
