"""Recordings with answers in closed form, and whether the metrics find them behind what a measurement does to them.

A case gives a recording at a rate and its answers in reporting units (one file a kind of test); a fault turns a
recording into what a logger would have stored. Each trial adds fresh noise, and asks whether the truth lies in the
metric's own 95 % interval.
"""
