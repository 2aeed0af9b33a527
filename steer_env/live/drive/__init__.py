"""A person at the wheel, in real time: the session that joins car, device and recording, and its window."""
