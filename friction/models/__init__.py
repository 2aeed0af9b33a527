"""The friction laws: one file for each law, which registers itself; no law imports another one."""
