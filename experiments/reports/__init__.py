"""Pages on one thing: the report on friction laws, a car, an assist, recordings, and the friction of a record."""
