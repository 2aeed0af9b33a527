"""Synthetic recordings whose metrics are known in closed form, and how often the metrics find them in spite of faults.

A case gives a recording at a sampling rate and its answers in reporting units; there is one file for each kind of test.
A fault turns a recording into one that sensors and a logger would have stored. Each trial adds new noise and checks
whether the true value is in the metric's own 95 % interval.
"""
